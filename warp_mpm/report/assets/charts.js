// Line charts as SVG: shared limits between runs, a cursor at the viewer's time, values under the pointer.

const INK = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#6e6e6e", "#e69f00"];
const DASHES = {solid: "", faint: "", dashed: "7 4", dotted: "2 3"};
const CHART = {width: 620, least: 300, height: 240, left: 62, right: 10, top: 8, bottom: 34};

function svgElement(name, attributes, parent) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (parent) parent.appendChild(element);
  return element;
}

function lineColour(line) {
  // The closed form has its own colours, so that it is told from the simulation where both are thin.
  return line.style === "dashed" ? "#000000" : line.style === "dotted" ? "#7a3e9d" : INK[line.colour % INK.length];
}

function limitsOf(charts) {
  let low = 0, high = 0;
  for (const chart of charts) for (const line of chart.lines) {
    if (line.style === "faint") continue;
    for (const value of line.v) { if (value < low) low = value; if (value > high) high = value; }
  }
  const margin = 0.05 * (high - low || 1);
  return [low < 0 ? low - margin : 0, high + margin];
}

function makeChart(parent, chart, end, limits, tip, onTime) {
  const box = document.createElement("div");
  box.className = "chart";
  box.innerHTML = "<h3></h3>";
  box.firstChild.textContent = `${chart.title} [${chart.unit}]`;
  parent.appendChild(box);
  const {height, left, right, top, bottom} = CHART;
  // As wide as its place, so that words keep their size beside three others and on a telephone.
  const width = Math.max(CHART.least, Math.min(CHART.width, box.clientWidth || CHART.width));
  const svg = svgElement("svg", {viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": chart.title}, box);
  const px = t => left + t / end * (width - left - right);
  const py = v => height - bottom - (v - limits[0]) / (limits[1] - limits[0]) * (height - top - bottom);
  const clip = "clip-" + Math.random().toString(36).slice(2);
  svgElement("rect", {x: left, y: top, width: width - left - right, height: height - top - bottom},
    svgElement("clipPath", {id: clip}, svg));
  const text = (x, y, words, anchor) => {
    const element = svgElement("text", {x, y, "text-anchor": anchor, "font-size": 12, fill: "#61656b"}, svg);
    element.textContent = words;
  };
  const xStep = niceStep(end, Math.max(3, width / 90)), yStep = niceStep(limits[1] - limits[0], 5);
  for (let k = 0; k * xStep <= end * (1 + 1e-9); k++) {
    svgElement("line", {x1: px(k * xStep), x2: px(k * xStep), y1: top, y2: height - bottom, stroke: "#ecebe7"}, svg);
    text(px(k * xStep), height - bottom + 15, formatTick(k * xStep, xStep), "middle");
  }
  for (let k = Math.ceil(limits[0] / yStep); k * yStep <= limits[1]; k++) {
    svgElement("line", {x1: left, x2: width - right, y1: py(k * yStep), y2: py(k * yStep),
      stroke: k ? "#ecebe7" : "#9a9a9a"}, svg);
    text(left - 6, py(k * yStep) + 4, Number(formatTick(k * yStep, yStep)).toLocaleString("en"), "end");
  }
  text((left + width - right) / 2, height - 3, "time [s]", "middle");
  const drawn = svgElement("g", {"clip-path": `url(#${clip})`}, svg);
  const legend = document.createElement("div");
  legend.className = "legend";
  box.appendChild(legend);
  chart.lines.forEach(line => {
    const d = line.t.map((t, i) => `${i ? "L" : "M"}${px(t).toFixed(1)} ${py(line.v[i]).toFixed(1)}`).join("");
    const path = svgElement("path", {d, fill: "none", stroke: lineColour(line), "stroke-linejoin": "round",
      "stroke-width": line.style === "faint" ? 0.8 : 1.7, "stroke-opacity": line.style === "faint" ? 0.35 : 1,
      "stroke-dasharray": DASHES[line.style]}, drawn);
    const entry = document.createElement("button");
    entry.type = "button";
    entry.innerHTML = `<svg width="26" height="8"><line x1="0" x2="26" y1="4" y2="4" stroke="${lineColour(line)}"
      stroke-width="2" stroke-dasharray="${DASHES[line.style]}" stroke-opacity="${line.style === "faint" ? 0.35 : 1}"/></svg>`;
    entry.append(line.label);
    entry.onclick = () => {
      line.hidden = !line.hidden; path.style.display = line.hidden ? "none" : ""; entry.classList.toggle("off", line.hidden);
    };
    legend.appendChild(entry);
  });
  const cursor = svgElement("line", {y1: top, y2: height - bottom, stroke: "#1d1d1f", "stroke-width": 1,
    "stroke-opacity": 0.55}, svg);
  const timeAt = event => {
    const area = svg.getBoundingClientRect();
    const t = ((event.clientX - area.left) / area.width * width - left) / (width - left - right) * end;
    return Math.min(Math.max(t, 0), end);
  };
  svg.addEventListener("pointermove", event => {
    const t = timeAt(event);
    const rows = chart.lines.filter(line => !line.hidden).map(line =>
      `${line.label}: ${valueAt(line, t).toLocaleString("en", {maximumSignificantDigits: 4})} ${chart.unit}`);
    tip.show(event, [`t = ${t.toFixed(3)} s`, ...rows].join("\n"));
  });
  svg.addEventListener("pointerleave", () => tip.hide());
  svg.addEventListener("click", event => onTime(timeAt(event)));
  return time => { const x = px(Math.min(time, end)); cursor.setAttribute("x1", x); cursor.setAttribute("x2", x); };
}

function valueAt(line, time) {
  let low = 0, high = line.t.length - 1;
  while (low < high) { const middle = (low + high) >> 1; if (line.t[middle] < time) low = middle + 1; else high = middle; }
  if (low > 0 && time - line.t[low - 1] < line.t[low] - time) low -= 1;
  return line.v[low];
}
