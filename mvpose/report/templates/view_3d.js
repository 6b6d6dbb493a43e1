"use strict";
// 3D views: drag or press the arrow keys to turn; wheel, pinch, + and - zoom; space plays where there are frames.
for (const place of document.querySelectorAll(".view-3d")) showView(place);

function showView(place) {
  const data = JSON.parse(place.querySelector("script").textContent);
  const canvas = place.querySelector("canvas"), pen = canvas.getContext("2d"), edge = 8;
  const slider = place.querySelector("input"), position = place.querySelector("output"), button = place.querySelector("button");
  let yaw = data.yaw, pitch = data.pitch, zoom = 1, frame = data.start, timer = 0;
  let axes, scale, width, height, middle, css;
  place.classList.add("alive");

  function aim() {
    const ratio = window.devicePixelRatio || 1, [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.lineCap = pen.lineJoin = "round";
    css = getComputedStyle(place);
    axes = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
    const [right, up, down] = data.extent; // of everything, from all sides
    scale = zoom * Math.min((width / 2 - edge) / right, (height - 2 * edge) / (up + down));
    middle = edge + (height - 2 * edge) * up / (up + down);
  }

  function color(name) { return name.startsWith("--") ? css.getPropertyValue(name).trim() : name; }

  // Project a point to the canvas: x, y, pixels per millimetre at its depth; null for one that is unknown or behind the eye.
  function projected(point) {
    if (!point) return null;
    const offset = point.map((value, axis) => value - data.center[axis]);
    const [right, up, near] = axes.map((axis) => axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2]);
    const away = data.distance - near;
    return away < 0.02 * data.distance ? null : [width / 2 + scale / away * right, middle - scale / away * up, scale / away];
  }

  // Begin the path of a polygon or line; false where a point cannot be shown.
  function path(points, closed) {
    if (points.includes(null)) return false;
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (points.length === 1) pen.lineTo(points[0][0], points[0][1]);
    if (closed) pen.closePath();
    return true;
  }

  function drawFaces({ shape, style, places }) {
    [pen.fillStyle, pen.globalAlpha] = [color(style.color), style.opacity];
    for (const corners of shape.faces) if (path(corners.map((k) => places[k]), true)) pen.fill();
    pen.globalAlpha = 1;
  }

  function drawLines({ shape, style, places }) {
    [pen.strokeStyle, pen.lineWidth] = [color(style.color), style.width];
    pen.setLineDash(style.dashed ? [4, 3] : []);
    for (const ends of shape.lines) if (path(ends.map((k) => places[k]), false)) pen.stroke();
    pen.setLineDash([]);
  }

  // Round bodies in three tones, as in light from the eye; the nearest ones last.
  function drawBodies(pieces) {
    const found = [];
    for (const { shape, style, places } of pieces) {
      if (!shape.bodies.length) continue;
      const middle = color(style.color);
      const tones = style.rim ? [color(style.rim), middle, middle] : [mixed(middle, "#000000", 0.3), middle, mixed(middle, "#ffffff", 0.25)];
      for (const [indices, radius] of shape.bodies) {
        const at = indices.map((k) => places[k]);
        if (!at.includes(null)) found.push({ at, radius, tones, near: at.reduce((sum, [, , size]) => sum + size, 0) / at.length });
      }
    }
    found.sort((one, other) => one.near - other.near);
    for (const { at, radius, tones, near } of found) {
      for (const [k, share] of [1, 0.74, 0.3].entries()) {
        pen.strokeStyle = pen.fillStyle = tones[k];
        pen.lineWidth = Math.max(1, 2 * radius * near * share);
        path(at, at.length > 2);
        if (at.length > 2) pen.fill();
        pen.stroke();
      }
    }
  }

  function draw() {
    aim();
    const prepared = ([shape, style, points]) => ({ shape: data.shapes[shape], style: data.styles[style], places: points.map(projected) });
    const fixed = data.fixed.map(prepared), moving = data.frames.length ? data.frames[frame].map(prepared) : [];
    [...fixed, ...moving].forEach(drawFaces);
    fixed.forEach(drawLines);
    drawBodies([...fixed, ...moving]);
    moving.forEach(drawLines);
    [pen.fillStyle, pen.font, pen.textAlign] = [color("--ink"), "13px system-ui, sans-serif", "center"];
    for (const [name, where] of data.names) {
      const at = projected(where);
      if (at) pen.fillText(name, at[0], at[1] - 7);
    }
    if (!slider) return;
    position.textContent = `frame ${data.first + frame}, ${data.times[frame].toFixed(1)} s`;
    slider.setAttribute("aria-valuetext", position.textContent);
  }

  function turn(right, up) {
    yaw -= right;
    pitch = Math.min(1.55, Math.max(-0.1, pitch + up));
    draw();
  }
  function zoomBy(factor) { zoom = Math.min(12, Math.max(0.4, zoom * factor)); draw(); }
  function go(to) { frame = (to + data.times.length) % data.times.length; slider.value = frame; draw(); }
  function play() {
    if (timer) { clearInterval(timer); timer = 0; }
    else {
      const step = data.times.length > 1 ? data.times[1] - data.times[0] : 1;
      timer = setInterval(() => go(frame + 1), Math.max(30, 1000 * step));
    }
    button.textContent = timer ? "Pause" : "Play";
  }

  if (slider) {
    [slider.max, slider.value] = [data.times.length - 1, frame];
    slider.addEventListener("input", () => go(Number(slider.value)));
    button.addEventListener("click", play);
  }
  draw(); // at once: the observer is called only with the next frame of the page, which is late on a busy machine
  controlView(canvas, { turn, zoomBy, draw, more: slider ? { " ": play } : {} });
}

// Turn and zoom a canvas by mouse, fingers and keys.
//
// turn(right, up): in radians; zoomBy(factor); draw(): on changes of size and colours; more: further keys and their functions.
function controlView(canvas, { turn, zoomBy, draw, more }) {
  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    fingers.set(event.pointerId, event);
    const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
    if (!other) return turn((event.clientX - before.clientX) / 130, (event.clientY - before.clientY) / 130);
    const apart = (finger) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
    if (apart(before) > 0) zoomBy(apart(event) / apart(before));
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return; // else the wheel scrolls the page
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / 500));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.12, 0), ArrowRight: () => turn(0.12, 0), ArrowUp: () => turn(0, 0.08), ArrowDown: () => turn(0, -0.08),
    "+": () => zoomBy(1.2), "=": () => zoomBy(1.2), "-": () => zoomBy(1 / 1.2), ...more,
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

// Mix one colour with a share of another; both "#rrggbb".
function mixed(color, other, share) {
  const parts = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const [one, two] = [parts(color), parts(other)];
  return `rgb(${one.map((value, k) => Math.round((1 - share) * value + share * two[k])).join(" ")})`;
}
