// The live page: asks the run twice a second what is new, and draws it.

const data = JSON.parse(document.getElementById("live-data").textContent);
const by = id => document.getElementById(id);
const colourTables = {sequential: palette(data.colours.sequential), signed: palette(data.colours.signed)};
const live = {samples: [], frame: 0, cloud: null, view: null, home: null, scales: {}, status: "", lost: 0};
window.live = live;
const PERIOD = 500;  // ms
const ENDED = ["finished", "stopped", "failed"];

const tip = {show() {}, hide() {}};

function seconds(value) {
  const whole = Math.round(value), minutes = Math.floor(whole / 60);
  return minutes >= 60 ? `${Math.floor(minutes / 60)} h ${minutes % 60} min` : `${minutes}:${String(whole % 60).padStart(2, "0")} min`;
}

function tell(state) {
  if (state.words !== live.status) { by("status").textContent = live.status = state.words; }
  by("progress").value = state.time / data.end;
  by("clock").textContent = `t = ${state.time.toFixed(2)} of ${data.end} s`;
  by("left").textContent = ENDED.includes(state.status) || state.left === null ? "" : `${seconds(state.left)} left`;
  const over = ENDED.includes(state.status);
  by("stop").disabled = over || state.stopping;
  by("keep").disabled = over || state.stopping || state.status !== "running";
  const said = over ? "" : state.stopping ? "The run ends after its present steps." : state.keeping ? "Keeping …"
    : state.kept !== null ? `Kept at t = ${state.kept.toFixed(2)} s.` : "";
  if (by("said").textContent !== said) by("said").textContent = said;
}

function widen(home, run, points) {
  // The window grows with what comes, and never shrinks, so that the picture stands still.
  let [left, right, bottom, top] = home || [Infinity, -Infinity, 0, -Infinity];
  const [a, b, c, d] = points.window, margin = 0.03 * Math.max(b - a, d - c, 1);
  left = Math.min(left, a - margin); right = Math.max(right, b + margin);
  bottom = Math.min(bottom, c - margin); top = Math.max(top, d + margin);
  run.barriers.forEach((barrier, i) => {
    for (const [x, y] of barrier.corners) {
      right = Math.max(right, x + (points.shifts[0][i] || 0) + 2); top = Math.max(top, y + margin);
    }
  });
  return [left, right, bottom, top];
}

function scaleOf(field) {
  const [low, high] = live.scales[field.name] || [Infinity, -Infinity];
  return live.scales[field.name] = [Math.min(low, field.scale[0]), Math.max(high, field.scale[1])];
}

function drawFlow() {
  if (!live.cloud) return;
  const points = live.cloud.points, field = points.fields.find(one => one.name === by("field").value) || points.fields[0];
  const [low, high] = scaleOf(field), colours = colourTables[field.signed ? "signed" : "sequential"];
  drawScale(by("scale"), colours, low, high, field.label);
  by("scale").setAttribute("aria-label", `colour scale of ${field.label}, ${low.toPrecision(2)} to ${high.toPrecision(2)} ${field.unit}`);
  drawCloud(by("points"), live.view, live.cloud, 0, live.cloud.fieldIndex(field.name), low, high, colours);
  const moved = data.barriers.map((barrier, i) => [barrier.name, points.shifts[0][i] || 0]).filter(([, shift]) => Math.abs(shift) > 5e-4);
  const words = `t = ${points.times[0].toFixed(2)} s, coloured by ${field.label} [${field.unit}]` +
    moved.map(([name, shift]) => `, ${name} moved ${shift.toFixed(3)} m`).join("") +
    (points.point_stride > 1 ? `; one in ${points.point_stride} points is shown` : "");
  by("shown").textContent = words;
  by("points").setAttribute("aria-label", "material points, " + words);
}

async function takeFrame(frame) {
  live.frame = frame.number;
  const run = {points: frame.points, ground: data.ground, barriers: data.barriers, section: data.section};
  live.cloud = new Cloud(run, await unpack(frame.numbers));
  if (!by("field").options.length) {
    for (const field of frame.points.fields) by("field").add(new Option(`${field.label} [${field.unit}]`, field.name));
  }
  const home = widen(live.home, run, frame.points);
  if (!live.home || home.some((side, i) => side !== live.home[i])) { live.home = home; live.view = new View(home); }
  drawFlow();
}

function drawCharts() {
  let first = 1;
  const charts = by("charts");
  // All places first: a chart is as wide as its place.
  charts.replaceChildren(...data.charts.map(() => document.createElement("div")));
  data.charts.forEach((chart, number) => {
    const lines = chart.columns.map((name, i) => {
      const rows = live.samples.filter(row => row[first + i] !== null);
      return {label: chart.labels[i], colour: i, style: "solid", t: rows.map(row => row[0]), v: rows.map(row => row[first + i] * chart.factor)};
    }).filter(line => line.t.length);
    first += chart.columns.length;
    if (!lines.length) return;
    const box = charts.children[number];
    if (lines.length === 1) box.className = "one";
    const shown = {title: chart.title, unit: chart.unit, lines};
    makeChart(box, shown, data.end, limitsOf([shown]), tip, () => {})(live.samples.at(-1)[0]);
    const last = lines[0].v.at(-1).toLocaleString("en", {maximumSignificantDigits: 4});
    box.querySelector(".chart > svg").setAttribute("aria-label", `${chart.title} over time, now ${last} ${chart.unit}`);
  });
}

async function look() {
  try {
    const answer = await fetch(`state?samples=${live.samples.length}&frame=${live.frame}`);
    if (!answer.ok) throw new Error(`the run answers ${answer.status}`);
    const state = await answer.json();
    live.lost = 0;
    by("problem").hidden = true;
    tell(state);
    if (state.frame) await takeFrame(state.frame);
    if (state.samples.length) { live.samples.push(...state.samples); drawCharts(); }
    document.body.dataset.ready = "yes";
    if (ENDED.includes(state.status)) { await fetch("heard", {method: "POST"}); return; }
  } catch (error) {
    // One answer may be lost; of a run that was killed no more come.
    if (++live.lost >= 3) {
      by("problem").hidden = false;
      by("problem").textContent = "The run does not answer any more: it has ended, or was ended. What it wrote is in its folder.";
      by("stop").disabled = by("keep").disabled = true;
      if (live.lost > 20) return;
    }
  }
  setTimeout(look, PERIOD);
}

async function ask(what) {
  by("said").textContent = what === "stop" ? "Asked to stop." : "Asked to keep what is there.";
  const answer = await fetch(what, {method: "POST"});
  if (!answer.ok) by("said").textContent = `The run refuses: ${answer.status}.`;
}

by("keep").onclick = () => ask("keep");
by("stop").onclick = () => by("sure").showModal();
by("sure").addEventListener("close", () => { if (by("sure").returnValue === "yes") ask("stop"); by("sure").returnValue = ""; });
by("field").onchange = drawFlow;
window.addEventListener("resize", () => { drawFlow(); if (live.samples.length) drawCharts(); });
look();
