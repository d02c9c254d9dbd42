// The page: tables, viewers, charts, and the clock that they share.

const data = JSON.parse(document.getElementById("report-data").textContent);
const runs = data.runs;
const by = id => document.getElementById(id);
const end = Math.max(...runs.map(run => run.end));
const colourTables = {sequential: palette(data.colours.sequential), signed: palette(data.colours.signed)};
const state = {time: 0, playing: false, field: "", low: 0, high: 1};
window.report = state;

const tip = {
  element: Object.assign(document.createElement("div"), {className: "tip", hidden: true}),
  show(event, words) {
    this.element.textContent = words; this.element.hidden = false;
    const area = this.element.getBoundingClientRect();
    this.element.style.left = Math.min(event.clientX + 14, window.innerWidth - area.width - 6) + "px";
    this.element.style.top = Math.min(event.clientY + 14, window.innerHeight - area.height - 6) + "px";
  },
  hide() { this.element.hidden = true; },
};
document.body.appendChild(tip.element);

function column(parent, run, className) {
  const box = document.createElement("div");
  if (className) box.className = className;
  if (runs.length > 1) {
    const name = document.createElement("p");
    name.className = "run-name"; name.textContent = run.name + " ";
    name.appendChild(Object.assign(document.createElement("small"), {textContent: run.title}));
    box.appendChild(name);
  }
  parent.appendChild(box);
  return box;
}

function heading(words, scope) {
  return Object.assign(document.createElement("th"), {textContent: words, scope});
}

function table(target, rows, header, differing) {
  // rows: [name, [a cell of each run]]
  const element = document.createElement("table");
  if (header) {
    const row = element.insertRow();
    row.insertCell();  // above the names of the rows
    header.forEach(words => row.appendChild(heading(words, "col")));
  }
  for (const [name, cells] of rows) {
    const row = element.insertRow();
    row.appendChild(heading(name, "row"));
    cells.forEach(cell => { row.insertCell().textContent = cell === undefined ? "–" : cell; });
    if (differing && new Set(cells).size > 1) row.className = "differs";
  }
  const box = document.createElement("div");
  box.className = "table-box"; box.appendChild(element);
  by(target).appendChild(box);
}

function tableOfRuns(target, pick, differing) {
  // pick(run) gives an object or a list of pairs; the rows are the union of all names, in order.
  const parts = runs.map(run => { const part = pick(run); return new Map(Array.isArray(part) ? part : Object.entries(part)); });
  const names = [...new Set(parts.flatMap(part => [...part.keys()]))];
  table(target, names.map(name => [name, parts.map(part => part.get(name))]),
    runs.length > 1 ? runs.map(run => run.name) : null, differing);
}

function fillTables() {
  by("subtitle").textContent = runs.length > 1 ? `${runs.length} runs side by side` : runs[0].description +
    (runs[0].source ? ". " + runs[0].source : "");
  for (const run of runs) for (const words of run.warnings) {
    by("warnings").appendChild(Object.assign(document.createElement("div"), {className: "warning",
      textContent: (runs.length > 1 ? run.name + ": " : "") + words}));
  }
  for (const run of runs) {
    const box = column(by("scenes"), run, "scene");
    box.insertAdjacentHTML("beforeend", run.scene);
    for (const note of run.notes) box.appendChild(Object.assign(document.createElement("p"), {className: "caption", textContent: note}));
  }
  for (const run of runs) if (run.loads) {
    by("loads").hidden = false;
    column(by("loads-of"), run, "loads").insertAdjacentHTML("beforeend", run.loads);
  }
  tableOfRuns("figure-table", run => run.figures);
  const fits = runs.flatMap(run => run.closed_form.map(fit => [run, fit]));
  if (fits.length) {
    const names = Object.keys(fits[0][1]).filter(name => name !== "rule");
    table("closed-form", names.map(name => [name, fits.map(([, fit]) => fit[name])]),
      fits.map(([run, fit]) => (runs.length > 1 ? run.name + ", " : "") + fit.rule));
  } else by("closed-form").textContent = "No impact to calibrate on.";
  tableOfRuns("ledger-table", run => run.ledger);
  tableOfRuns("effects-table", run => run.effects, true);
  tableOfRuns("settings-table", run => run.settings, true);
  tableOfRuns("versions-table", run => run.versions, true);
  if (runs.length > 1) by("differences").textContent = "Shaded rows differ between the runs.";
}

function travelOf(run, barrier) {
  // How far a barrier gets downstream.
  return Math.max(0, ...run.points.shifts.map(shifts => shifts[barrier] || 0));
}

function unionWindow() {
  // One window for all runs, so that lengths compare; the barrier and its travel are inside.
  let [left, right, bottom, top] = [Infinity, -Infinity, 0, -Infinity];
  for (const run of runs) {
    const [a, b, c, d] = run.points.window;
    left = Math.min(left, a); right = Math.max(right, b); bottom = Math.min(bottom, c); top = Math.max(top, d);
    run.barriers.forEach((barrier, i) => {
      if (barrier.kind === "wall") right = Math.max(right, barrier.corners[0][0] + 2);
      else for (const [x, y] of barrier.corners) { right = Math.max(right, x + travelOf(run, i)); top = Math.max(top, y); }
    });
    for (const [x, y] of run.ground || []) if (x > left && x < right) bottom = Math.min(bottom, y);
  }
  const margin = 0.03 * Math.max(right - left, top - bottom);
  return [left - margin, right + margin, bottom - 1.5 * margin, top + margin];
}

function nearWindow(whole) {
  // The flow as it starts and the barrier with its travel, and room above for the run-up.
  let [left, right, , top] = [Infinity, -Infinity, 0, -Infinity];
  for (const run of runs) {
    left = Math.min(left, run.points.start[0]); right = Math.max(right, run.points.start[1], 0);
    top = Math.max(top, run.points.start[3]);
    run.barriers.forEach((barrier, i) => {
      for (const [x, y] of barrier.corners) { right = Math.max(right, x + travelOf(run, i)); top = Math.max(top, y); }
    });
  }
  const margin = 0.04 * (right - left);
  return [left - margin, Math.min(right + 4 * margin, whole[1]), whole[2], Math.min(top + 1.4 * Math.abs(top), whole[3])];
}

function fieldOf(name) {
  for (const run of runs) { const field = run.points.fields.find(one => one.name === name); if (field) return field; }
  return null;
}

function sharedScale(name) {
  const fields = runs.map(run => run.points.fields.find(field => field.name === name)).filter(Boolean);
  const round = value => Number(value.toPrecision(2));
  return [round(Math.min(...fields.map(field => field.scale[0]))), round(Math.max(...fields.map(field => field.scale[1])))];
}

async function start() {
  fillTables();
  const clouds = await Promise.all(runs.map(async (run, index) => {
    const holder = by("points-" + index), cloud = new Cloud(run, await unpack(holder.textContent));
    holder.remove();
    return cloud;
  }));
  const home = unionWindow();
  const view = new View(nearWindow(home));
  const canvases = clouds.map(cloud => {
    const box = column(by("viewers"), cloud.run);
    const canvas = Object.assign(document.createElement("canvas"), {className: "viewer"});
    canvas.setAttribute("aria-label", "material points of " + cloud.run.name);
    box.appendChild(canvas);
    const {frame_stride: frames, point_stride: points} = cloud.points;
    const share = (stride, what) => stride > 1 ? `one in ${stride} ${what}` : `all ${what}`;
    if (frames > 1 || points > 1) {
      box.appendChild(Object.assign(document.createElement("p"), {className: "hint", textContent:
        `Shown here: ${share(frames, "snapshots")}, ${share(points, "points")}; all are in the run folder.`}));
    }
    return canvas;
  });

  const names = [...new Set(runs.flatMap(run => run.points.fields.map(field => field.name)))];
  for (const name of names) {
    const field = fieldOf(name);
    by("field").appendChild(Object.assign(document.createElement("option"),
      {value: name, textContent: `${field.label} [${field.unit}]`}));
  }

  const draw = () => {
    const field = fieldOf(state.field), colours = colourTables[field && field.signed ? "signed" : "sequential"];
    clouds.forEach((cloud, index) => drawCloud(canvases[index], view, cloud, cloud.frameAt(state.time),
      cloud.fieldIndex(state.field), state.low, state.high, colours));
    by("clock").value = `t = ${state.time.toFixed(2)} s`;
    by("scrub").value = Math.round(state.time / end * 1000);
    cursors.forEach(move => move(state.time));
  };
  const setTime = time => { state.time = Math.min(Math.max(time, 0), end); draw(); };
  const setScale = (low, high) => {
    const field = fieldOf(state.field);
    state.low = low; state.high = high > low ? high : low + 1e-9;
    by("low").value = low; by("high").value = high; by("unit").textContent = field.unit;
    drawScale(by("scale"), colourTables[field.signed ? "signed" : "sequential"], state.low, state.high, field.label);
    draw();
  };
  const setField = name => { state.field = name; by("field").value = name; setScale(...sharedScale(name)); };

  const chartTitles = [...new Set(runs.flatMap(run => run.charts.map(chart => chart.title)))];
  const cursors = [];
  const onTime = time => { pause(); setTime(time); };
  if (runs.length === 1) by("charts").className = "columns wrap";
  for (const title of chartTitles) {
    const ofRuns = runs.map(run => run.charts.find(chart => chart.title === title));
    const limits = limitsOf(ofRuns.filter(Boolean));
    const row = runs.length === 1 ? by("charts")
      : by("charts").appendChild(Object.assign(document.createElement("div"), {className: "columns"}));
    ofRuns.forEach((chart, index) => {
      const box = runs.length === 1 ? row : column(row, runs[index]);
      if (chart) cursors.push(makeChart(box, chart, end, limits, tip, onTime));
    });
  }

  const stills = drawStills(clouds, home);

  let last = 0;
  const tick = now => {
    if (!state.playing) return;
    state.time += last ? (now - last) / 1000 * Number(by("rate").value) : 0;
    last = now;
    if (state.time >= end) { state.time = end; pause(); }
    draw();
    if (state.playing) requestAnimationFrame(tick);
  };
  const play = () => {
    if (state.time >= end) state.time = 0;
    state.playing = true; last = 0;
    by("play").textContent = "❚❚ Pause"; by("play").setAttribute("aria-pressed", "true");
    requestAnimationFrame(tick);
  };
  const pause = () => {
    state.playing = false; by("play").textContent = "▶ Play"; by("play").setAttribute("aria-pressed", "false");
  };
  by("play").onclick = () => (state.playing ? pause : play)();
  by("scrub").oninput = event => { pause(); setTime(Number(event.target.value) / 1000 * end); };
  by("field").onchange = event => setField(event.target.value);
  by("low").onchange = by("high").onchange = () => setScale(Number(by("low").value), Number(by("high").value));
  const look = target => { view.home = target; view.reset(); draw(); };
  by("near").onclick = () => look(nearWindow(home));
  by("whole").onclick = () => look(home);
  document.addEventListener("keydown", event => {
    if (["INPUT", "SELECT", "TEXTAREA"].includes(event.target.tagName)) return;
    if (event.key === " " && event.target.tagName !== "BUTTON") { by("play").click(); event.preventDefault(); }
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (step) {
      const times = clouds[0].points.times, frame = clouds[0].frameAt(state.time) + step;
      pause(); setTime(times[Math.min(Math.max(frame, 0), times.length - 1)]);
    }
  });
  canvases.forEach((canvas, index) => watchPointer(canvas, clouds[index], view, draw));
  window.addEventListener("resize", () => { draw(); stills(); });

  const peak = runs[0].peak_time;
  state.time = peak === null || peak === undefined ? 0 : peak;
  setField(names[0]);
  document.body.dataset.ready = "yes";
}

function watchPointer(canvas, cloud, view, draw) {
  let drag = null;
  canvas.addEventListener("pointerdown", event => { drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { drag = null; });
  canvas.addEventListener("pointerleave", () => tip.hide());
  canvas.addEventListener("pointermove", event => {
    if (drag) {
      view.x -= (event.clientX - drag[0]) / view.scale; view.y += (event.clientY - drag[1]) / view.scale;
      drag = [event.clientX, event.clientY]; tip.hide(); draw();
      return;
    }
    const frame = cloud.frameAt(state.time), point = nearestPoint(cloud, frame, view, event.offsetX, event.offsetY);
    if (point < 0) { tip.hide(); return; }
    const lines = [`x = ${cloud.toValue(0, cloud.raw(frame, 0)[point]).toFixed(2)} m, ` +
      `y = ${cloud.toValue(1, cloud.raw(frame, 1)[point]).toFixed(2)} m`];
    cloud.points.fields.forEach((field, index) => {
      const value = cloud.toValue(2 + index, cloud.raw(frame, 2 + index)[point]);
      // What is below the step of the packing is nil.
      const [low, high] = cloud.points.ranges[2 + index], shown = Math.abs(value) < (high - low) / 65535 ? 0 : value;
      const unit = field.unit === "-" ? "" : " " + field.unit;
      lines.push(`${field.label}: ${shown.toLocaleString("en", {maximumSignificantDigits: 3})}${unit}`);
    });
    tip.show(event, lines.join("\n"));
  });
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    const x = view.mx(event.offsetX), y = view.my(event.offsetY), factor = Math.exp(-event.deltaY * 0.0015);
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.2), 60);
    const scale = view.scale * factor;
    view.x = x - (event.offsetX - view.width / 2) / scale; view.y = y + (event.offsetY - view.height / 2) / scale;
    draw();
  }, {passive: false});
}

function drawStills(clouds, home) {
  const name = clouds.some(cloud => cloud.fieldIndex("pore_pressure") >= 0) ? "pore_pressure" : "speed";
  const field = fieldOf(name), colours = colourTables.sequential, [low, high] = sharedScale(name);
  by("stills-title").textContent = `${field.label[0].toUpperCase()}${field.label.slice(1)} at chosen times [${field.unit}]`;
  drawScale(by("stills-scale"), colours, low, high, field.label);
  const pictures = [];
  for (const time of data.times) {
    const row = Object.assign(document.createElement("div"), {className: "columns"});
    by("still-rows").appendChild(row);
    for (const cloud of clouds) {
      const box = column(row, cloud.run), frame = cloud.frameAt(time), index = cloud.fieldIndex(name);
      const caption = Object.assign(document.createElement("p"), {className: "caption"});
      const moved = cloud.run.barriers.map((barrier, i) => [barrier.name, cloud.points.shifts[frame][i] || 0]).filter(([, shift]) => shift);
      let most = 0;
      if (index >= 0) for (const value of cloud.raw(frame, 2 + index)) most = Math.max(most, cloud.toValue(2 + index, value));
      caption.textContent = `t = ${cloud.points.times[frame].toFixed(2)} s, greatest ${field.label} ` +
        `${most.toFixed(0)} ${field.unit}` + moved.map(([name, shift]) => `, ${name} moved ${shift.toFixed(2)} m`).join("");
      const canvas = Object.assign(document.createElement("canvas"), {className: "still", role: "img"});
      canvas.setAttribute("aria-label", `${cloud.run.name}: ${caption.textContent}`);
      box.append(caption, canvas);
      pictures.push(() => drawCloud(canvas, new View(home), cloud, frame, index, low, high, colours));
    }
  }
  const redraw = () => pictures.forEach(picture => picture());
  redraw();
  return redraw;
}

start().catch(error => {
  by("problem").hidden = false;
  by("problem").textContent = "This page could not be drawn: " + error.message +
    " (it needs a browser of 2023 or later).";
  console.error(error);
});
