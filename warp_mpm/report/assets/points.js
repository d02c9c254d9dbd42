// Snapshots: unpacking, drawing to scale, and finding the point under the pointer.

async function unpack(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint16Array(await new Response(stream).arrayBuffer());
}

function palette(hex) {
  const colours = [];
  for (let i = 0; i < 256; i++) colours.push("#" + hex.slice(6 * i, 6 * i + 6));
  return colours;
}

class Cloud {
  // The snapshots of one run. Quantities 0 and 1 are x and y, the others the fields.
  constructor(run, numbers) {
    this.run = run;
    this.points = run.points;
    this.numbers = numbers;
    const quantities = 2 + this.points.fields.length;
    this.starts = [];
    let start = 0;
    for (const count of this.points.counts) { this.starts.push(start); start += quantities * count; }
  }
  frameAt(time) {
    const times = this.points.times;
    let low = 0, high = times.length - 1;
    while (low < high) { const middle = (low + high) >> 1; if (times[middle] < time) low = middle + 1; else high = middle; }
    return low > 0 && time - times[low - 1] < times[low] - time ? low - 1 : low;
  }
  raw(frame, quantity) {
    const count = this.points.counts[frame], start = this.starts[frame] + quantity * count;
    return this.numbers.subarray(start, start + count);
  }
  toValue(quantity, raw) {
    const [low, high] = this.points.ranges[quantity];
    return low + raw / 65535 * (high - low);
  }
  fieldIndex(name) { return this.points.fields.findIndex(field => field.name === name); }
}

class View {
  // Metres to pixels. Both axes have one scale.
  constructor(window_) { this.home = window_; this.reset(); }
  reset() { this.x = (this.home[0] + this.home[1]) / 2; this.y = (this.home[2] + this.home[3]) / 2; this.zoom = 1; }
  fit(width, height) {
    const [left, right, bottom, top] = this.home;
    this.scale = this.zoom * Math.min(width / (right - left), height / (top - bottom));
    this.width = width; this.height = height;
  }
  px(x) { return this.width / 2 + (x - this.x) * this.scale; }
  py(y) { return this.height / 2 - (y - this.y) * this.scale; }
  mx(px) { return this.x + (px - this.width / 2) / this.scale; }
  my(py) { return this.y - (py - this.height / 2) / this.scale; }
}

function prepareCanvas(canvas, aspect) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth || 600;
  const height = Math.round(Math.min(Math.max(width / aspect, 130), 460));
  canvas.style.height = height + "px";
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

function niceStep(span, parts) {
  const rough = span / parts, power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find(factor => factor * power >= rough);
}

function drawAxes(pen, view, labels) {
  // Lines go under the material, labels over it.
  pen.font = "11px system-ui, sans-serif"; pen.fillStyle = "#61656b"; pen.strokeStyle = "#ecebe7"; pen.lineWidth = 1;
  const step = niceStep(view.width / view.scale, Math.max(3, view.width / 90));
  pen.textBaseline = "bottom"; pen.textAlign = "center";
  const left = view.mx(0), right = view.mx(view.width);
  for (let k = Math.ceil(left / step); k * step < right; k++) {
    const px = view.px(k * step);
    if (!labels) { pen.beginPath(); pen.moveTo(px, 0); pen.lineTo(px, view.height); pen.stroke(); }
    else if (px > 24 && px < view.width - 40) pen.fillText(formatTick(k * step, step), px, view.height - 2);
  }
  pen.textAlign = "left"; pen.textBaseline = "middle";
  const top = view.my(0), bottom = view.my(view.height);
  for (let k = Math.ceil(bottom / step); k * step < top; k++) {
    const py = view.py(k * step);
    if (!labels) { pen.beginPath(); pen.moveTo(0, py); pen.lineTo(view.width, py); pen.stroke(); }
    else if (py > 14 && py < view.height - 16) pen.fillText(formatTick(k * step, step), 3, py);
  }
  if (!labels) return;
  pen.textAlign = "right"; pen.textBaseline = "bottom"; pen.fillText("x [m]", view.width - 4, view.height - 2);
  pen.textAlign = "left"; pen.textBaseline = "top"; pen.fillText("y [m]", 3, 2);
}

function formatTick(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return (Math.abs(value) < step / 2 ? 0 : value).toFixed(digits);
}

function groundHeight(line, x) {
  // The surface goes on straight beyond its points.
  let k = 1;
  while (k < line.length - 1 && line[k][0] < x) k++;
  const [[x0, y0], [x1, y1]] = [line[k - 1], line[k]];
  return x1 === x0 ? y1 : y0 + (x - x0) * (y1 - y0) / (x1 - x0);
}

function drawGround(pen, view, line) {
  if (!line) return;
  const left = view.mx(0), right = view.mx(view.width);
  const shown = [[left, groundHeight(line, left)], ...line.filter(([x]) => x > left && x < right), [right, groundHeight(line, right)]];
  const trace = () => shown.forEach(([x, y], i) => (i ? pen.lineTo : pen.moveTo).call(pen, view.px(x), view.py(y)));
  pen.beginPath(); trace(); pen.lineTo(view.width, view.height + 1e5); pen.lineTo(0, view.height + 1e5); pen.closePath();
  pen.fillStyle = "#d9d2c5"; pen.fill();
  pen.beginPath(); trace(); pen.strokeStyle = "#61656b"; pen.lineWidth = 1; pen.stroke();
}

function drawSection(pen, view, section) {
  if (!section) return;
  pen.beginPath(); section.forEach(([x, y], i) => (i ? pen.lineTo : pen.moveTo).call(pen, view.px(x), view.py(y)));
  pen.setLineDash([2, 3]); pen.strokeStyle = "#0072b2"; pen.lineWidth = 1.2; pen.stroke(); pen.setLineDash([]);
}

function drawBarrier(pen, view, barrier, shift, ghost) {
  const trace = offset => {
    pen.beginPath();
    const [[x0, y0]] = barrier.corners;
    if (barrier.kind === "wall") pen.rect(view.px(x0 + offset), view.py(y0) - 1e5, 1e5, 1e5);
    else {
      barrier.corners.forEach(([x, y], i) => (i ? pen.lineTo : pen.moveTo).call(pen, view.px(x + offset), view.py(y)));
      pen.closePath();
    }
  };
  trace(shift); pen.fillStyle = "#b5b5b5"; pen.fill(); pen.strokeStyle = "#333"; pen.lineWidth = 1; pen.stroke();
  if (ghost && Math.abs(shift) > 1e-6) {
    pen.setLineDash([3, 3]); trace(0); pen.strokeStyle = "#61656b"; pen.stroke(); pen.setLineDash([]);
  }
}

function drawCloud(canvas, view, cloud, frame, field, low, high, colours) {
  const home = view.home;
  const [pen, width, height] = prepareCanvas(canvas, (home[1] - home[0]) / (home[3] - home[2]));
  view.fit(width, height);
  drawAxes(pen, view, false);
  drawGround(pen, view, cloud.run.ground);
  cloud.run.barriers.forEach((barrier, i) => drawBarrier(pen, view, barrier, cloud.points.shifts[frame][i] || 0, true));
  drawSection(pen, view, cloud.run.section);
  const xs = cloud.raw(frame, 0), ys = cloud.raw(frame, 1);
  const [xLow, xHigh] = cloud.points.ranges[0], [yLow, yHigh] = cloud.points.ranges[1];
  const xScale = (xHigh - xLow) / 65535, yScale = (yHigh - yLow) / 65535;
  const size = Math.max(cloud.points.diameter * view.scale, 1.6);
  // Points of one colour are drawn together: setting the colour is what takes the time.
  const buckets = Array.from({length: 256}, () => []);
  if (field < 0) buckets[0] = Array.from(xs.keys());
  else {
    const values = cloud.raw(frame, 2 + field), [vLow, vHigh] = cloud.points.ranges[2 + field];
    const scale = 255.999 / (high - low || 1), slope = (vHigh - vLow) / 65535;
    for (let i = 0; i < values.length; i++) {
      const level = Math.floor((vLow + values[i] * slope - low) * scale);
      buckets[level < 0 ? 0 : level > 255 ? 255 : level].push(i);
    }
  }
  buckets.forEach((members, level) => {
    if (!members.length) return;
    pen.fillStyle = field < 0 ? "#8a8a8a" : colours[level];
    for (const i of members) {
      const px = view.px(xLow + xs[i] * xScale), py = view.py(yLow + ys[i] * yScale);
      pen.fillRect(px - size / 2, py - size / 2, size, size);
    }
  });
  drawAxes(pen, view, true);
}

function nearestPoint(cloud, frame, view, px, py) {
  // Number of the point nearest to the pixel, or -1 when none is near.
  const xs = cloud.raw(frame, 0), ys = cloud.raw(frame, 1);
  let best = -1, least = Math.max(8, cloud.points.diameter * view.scale) ** 2;
  for (let i = 0; i < xs.length; i++) {
    const dx = view.px(cloud.toValue(0, xs[i])) - px, dy = view.py(cloud.toValue(1, ys[i])) - py;
    const distance = dx * dx + dy * dy;
    if (distance < least) { least = distance; best = i; }
  }
  return best;
}

function drawScale(canvas, colours, low, high, label) {
  const pen = canvas.getContext("2d"), width = canvas.width, bar = width - 60;
  pen.clearRect(0, 0, width, canvas.height);
  for (let i = 0; i < 256; i++) { pen.fillStyle = colours[i]; pen.fillRect(30 + i * bar / 256, 2, bar / 256 + 1, 12); }
  pen.fillStyle = "#1d1d1f"; pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "top";
  const step = niceStep(high - low || 1, 5);
  pen.textAlign = "center";
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    const x = 30 + (k * step - low) / (high - low || 1) * bar;
    pen.fillRect(x, 14, 1, 3);
    pen.fillText(formatTick(k * step, step), x, 18);
  }
  canvas.title = label;
}
