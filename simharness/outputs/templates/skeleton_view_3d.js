// 3D view of people: drag or press the arrow keys to turn; wheel, pinch, + and - zoom; space plays.
for (const place of document.querySelectorAll(".view-3d")) showView(place);

function showView(place) {
  const data = JSON.parse(place.querySelector("script").textContent);
  const canvas = place.querySelector("canvas"), pen = canvas.getContext("2d");
  const slider = place.querySelector("input"), position = place.querySelector("output"), button = place.querySelector("button");
  let yaw = data.yaw, pitch = data.pitch, zoom = 1, frame = data.start, timer = 0;
  let axes, scale, width, height;
  place.classList.add("alive");
  slider.max = data.time.length - 1;
  slider.value = frame;

  function aim() {
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    axes = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
    scale = zoom * wholeScale();
  }

  // The scale at which all cameras and people are whole, from all sides at the first pitch.
  function wholeScale() {
    const points = [...data.cameras.flat(), ...data.truth[data.start].flat().filter(Boolean)];
    const [sp, cp] = [Math.sin(data.pitch), Math.cos(data.pitch)];
    let least = Infinity;
    for (let turned = 0; turned < 2 * Math.PI; turned += Math.PI / 12) {
      const [sy, cy] = [Math.sin(turned), Math.cos(turned)];
      for (const point of points) {
        const [x, y, z] = point.map((value, axis) => value - data.center[axis]);
        const ahead = cy * x + sy * y, away = data.far * data.radius - (cp * ahead + sp * z);
        const right = Math.abs(cy * y - sy * x) / away, up = (cp * z - sp * ahead) / away;
        const room = up > 0 ? data.middle * height : (1 - data.middle) * height;
        least = Math.min(least, (width / 2 - 8) / Math.max(right, 1e-9), (room - 8) / Math.max(Math.abs(up), 1e-9));
      }
    }
    return least;
  }

  // Project a point of the world to the canvas: x, y, pixels per millimetre at its depth, nearness; null behind the eye.
  function projected(point) {
    const offset = point.map((value, axis) => value - data.center[axis]);
    const [right, up, near] = axes.map((axis) => axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2]);
    const away = data.far * data.radius - near;
    if (away < 0.05 * data.radius) return null;
    return [width / 2 + scale / away * right, data.middle * height - scale / away * up, scale / away, near];
  }

  function line(from, to, color, thick) {
    const a = projected(from), b = projected(to);
    if (!a || !b) return;
    pen.strokeStyle = color;
    pen.lineWidth = thick;
    pen.beginPath();
    pen.moveTo(a[0], a[1]);
    pen.lineTo(b[0], b[1]);
    pen.stroke();
  }

  // Parts of a body with their nearness: capsules around limbs and neck, the trunk, and a ball for the head.
  function parts(joints, color) {
    const found = [], mean = (points) => [0, 1, 2].map((axis) => points.reduce((sum, point) => sum + point[axis], 0) / points.length);
    const add = (points, radius) => {
      const places = points.map(projected);
      if (places.every(Boolean)) found.push({ places, radius, color, near: mean(places.map((place) => [place[3], 0, 0]))[0] });
    };
    for (const [a, b, radius] of data.capsules) if (joints[a] && joints[b]) add([joints[a], joints[b]], radius);
    const trunk = data.trunk[0].map((joint) => joints[joint]), face = data.head[0].map((joint) => joints[joint]).filter(Boolean);
    if (trunk.every(Boolean)) add(trunk, data.trunk[1]);
    if (face.length) {
      add([mean(face)], data.head[1]);
      if (trunk[0] && trunk[1]) add([mean(trunk.slice(0, 2)), mean(face)], data.neck);
    }
    return found;
  }

  // Draw a part in three tones, as a round body in light from the eye.
  function body({ places, radius, color }) {
    const thick = 2 * radius * places.reduce((sum, place) => sum + place[2], 0) / places.length;
    pen.lineJoin = "round";
    for (const [share, tone] of [[1, color[0]], [0.74, color[1]], [0.3, color[2]]]) {
      pen.strokeStyle = pen.fillStyle = tone;
      pen.lineWidth = Math.max(1, share * thick);
      pen.beginPath();
      pen.moveTo(places[0][0], places[0][1]);
      for (const place of places.length > 1 ? places.slice(1) : places) pen.lineTo(place[0], place[1]);
      if (places.length > 2) { pen.closePath(); pen.fill(); }
      pen.stroke();
    }
  }

  function limbs(joints) {
    return data.edges.filter(([a, b]) => joints[a] && joints[b]).map(([a, b]) => [joints[a], joints[b]]);
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1, style = getComputedStyle(place);
    [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.lineCap = "round";
    const [ink, faint, rule] = ["--ink", "--faint", "--line"].map((name) => style.getPropertyValue(name).trim());
    aim();
    for (const axis of [0, 1]) {
      const half = data.room[axis] / 2, side = data.room[1 - axis] / 2, steps = [-half, half];
      for (let step = Math.ceil(-half / 1000) * 1000; step <= half; step += 1000) steps.push(step);
      for (const step of steps) {
        const ends = [[0, 0, 0], [0, 0, 0]];
        [ends[0][axis], ends[0][1 - axis], ends[1][axis], ends[1][1 - axis]] = [step, -side, step, side];
        line(ends[0], ends[1], rule, 1);
      }
    }
    for (const box of data.boxes) for (const [a, b] of data.corners) line(box[a], box[b], faint, 0.7);
    for (const [apex, ...base] of data.cameras) {
      base.forEach((corner, k) => { line(apex, corner, faint, 1); line(corner, base[(k + 1) % 4], faint, 1); });
    }
    const solid = [], found = new Set();
    for (const [owner, ...joints] of data.estimates[frame]) {
      found.add(owner);
      const color = owner < 0 ? data.ghost : data.colors[owner];
      solid.push(...parts(joints, [mixed(color, "#000000", 0.3), color, mixed(color, "#ffffff", 0.25)]));
    }
    data.truth[frame].forEach((joints, person) => {
      if (!found.has(person)) solid.push(...parts(joints, [faint, rule, rule])); // a pale body: nobody was estimated here
    });
    solid.sort((one, other) => one.near - other.near).forEach(body);
    data.truth[frame].forEach((joints, person) => {
      pen.setLineDash(found.has(person) ? [] : [4, 3]);
      for (const [a, b] of limbs(joints)) line(a, b, ink, 1.5);
    });
    pen.setLineDash([]);
    position.textContent = `frame ${data.first + frame}, ${data.time[frame].toFixed(1)} s`;
    slider.setAttribute("aria-valuetext", position.textContent);
  }

  function turn(right, up) {
    yaw -= right;
    pitch = Math.min(1.55, Math.max(-0.1, pitch + up));
    draw();
  }
  function zoomBy(factor) { zoom = Math.min(12, Math.max(0.4, zoom * factor)); draw(); }
  function go(to) { frame = (to + data.time.length) % data.time.length; slider.value = frame; draw(); }
  function play() {
    if (timer) { clearInterval(timer); timer = 0; }
    else {
      const step = data.time.length > 1 ? data.time[1] - data.time[0] : 1;
      timer = setInterval(() => go(frame + 1), Math.max(30, 1000 * step));
    }
    button.textContent = timer ? "Pause" : "Play";
  }

  slider.addEventListener("input", () => go(Number(slider.value)));
  button.addEventListener("click", play);
  draw(); // at once: the observer is called only with the next frame of the page, which is late on a busy machine
  controlView(canvas, { turn, zoomBy, draw, more: { " ": play } });
}

// Mix one colour with a share of another; both "#rrggbb".
function mixed(color, other, share) {
  const parts = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const [one, two] = [parts(color), parts(other)];
  return `rgb(${one.map((value, k) => Math.round((1 - share) * value + share * two[k])).join(" ")})`;
}
