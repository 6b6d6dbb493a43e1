// 3D view of a rig: drag or press the arrow keys to turn; wheel, pinch, + and - zoom.
for (const place of document.querySelectorAll(".rig-3d")) showRig(place);

function showRig(place) {
  const data = JSON.parse(place.querySelector("script").textContent);
  const canvas = place.querySelector("canvas"), pen = canvas.getContext("2d");
  let yaw = data.yaw, pitch = data.pitch, zoom = 1, axes, scale, width, height;
  place.classList.add("alive");

  function projected(point) {
    const offset = point.map((value, axis) => value - data.center[axis]);
    const [right, up, near] = axes.map((axis) => axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2]);
    const away = data.far * data.radius - near;
    if (away < 0.05 * data.radius) return null;
    return [width / 2 + scale / away * right, height / 2 - scale / away * up];
  }

  function shape(points, closed) {
    const at = points.map(projected);
    if (at.includes(null)) return false;
    pen.beginPath();
    at.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (closed) pen.closePath();
    return true;
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1, style = getComputedStyle(place);
    const color = (name) => (name.startsWith("--") ? style.getPropertyValue(name).trim() : name);
    [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.lineCap = "round";
    const [sy, cy, sp, cp] = [Math.sin(yaw), Math.cos(yaw), Math.sin(pitch), Math.cos(pitch)];
    axes = [[-sy, cy, 0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]];
    scale = zoom * data.far * Math.min(width / 2.3, height / 1.75);
    pen.fillStyle = data.tile;
    pen.globalAlpha = 0.22;
    for (const tile of data.tiles) if (shape(tile, true)) pen.fill();
    pen.globalAlpha = 1;
    for (const group of data.lines) {
      [pen.strokeStyle, pen.lineWidth] = [color(group.color), group.width];
      for (const line of group.at) if (shape(line, false)) pen.stroke();
    }
    pen.fillStyle = color("--ink");
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const [name, where] of data.names) {
      const at = projected(where);
      if (at) pen.fillText(name, at[0], at[1] - 7);
    }
  }

  function turn(right, up) {
    yaw -= right;
    pitch = Math.min(1.55, Math.max(-0.1, pitch + up));
    draw();
  }
  function zoomBy(factor) { zoom = Math.min(8, Math.max(0.4, zoom * factor)); draw(); }

  draw();
  controlView(canvas, { turn, zoomBy, draw });
}
