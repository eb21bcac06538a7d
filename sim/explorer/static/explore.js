"use strict";
// The page of `sim explore`: native inputs and plotly's drawing. All physics is computed by Python.

const $ = (id) => document.getElementById(id);
const narrow = matchMedia("(max-width: 800px)");
const dark = matchMedia("(prefers-color-scheme: dark)");
const STEPS = 300;
const COLOURS = { bonds: "#0072B2", fluctuations: "#D55E00", stress: "#8b6bb1", rest: "#8a8a8a", own: "#009E73" };

const GREEK = { alpha: "α", chi: "χ", delta: "δ", Delta: "Δ", kappa: "κ", nu: "ν", tau: "τ" };

let token = "";
let sliders = [];
let ghost = null;
let shown = null; // the last answer
let own = null; // the band of a few members that follows the sliders
let ran = null; // the ensemble that was run
let slow = false; // true if the band cannot follow
let table = null; // the digest of the measured curves
let touched = ""; // the key that was changed last
const state = { values: {}, share: 0.1, absolute: false, first: false, loads: false };
const SHOWN = ["absolute", "first", "loads"];
const undone = [];

/** Return an element with a text and attributes. */
function element(name, text = "", attributes = {}) {
  const result = document.createElement(name);
  result.textContent = text;
  for (const [key, value] of Object.entries(attributes)) result.setAttribute(key, value);
  return result;
}

/** Send a request. */
async function post(path, request, signal = null) {
  try {
    return await fetch(path, { method: "POST", headers: { "content-type": "application/json", "x-token": token }, body: JSON.stringify(request), signal });
  } catch (fault) {
    if (fault.name === "AbortError") throw fault;
    throw new Error("The server has ended. Run sim explore again.");
  }
}

/** Return Python's answer to a request. */
async function ask(path, request) {
  const answer = await post(path, request);
  const isTable = answer.headers.get("content-type").includes("json");
  const result = isTable ? await answer.json() : await answer.blob();
  if (!answer.ok) throw new Error(result.message);
  return result;
}

/** Return a function that asks for the latest state alone: what is changed while an answer is due is asked after it. */
function latest(request) {
  let busy = false;
  let again = false;
  return async function run() {
    again = true;
    if (busy) return;
    busy = true;
    try {
      while (again) {
        again = false;
        await request();
      }
    } catch (fault) {
      complain(String(fault.message || fault));
    } finally {
      busy = false;
    }
  };
}

/** Show a message of the whole page, or take it away. */
function complain(text) {
  const old = $("trouble");
  if (old) old.remove();
  if (text) document.querySelector("header").append(element("p", text, { id: "trouble", role: "alert", class: "fault" }));
}

// The values and the address

/** Return the place of a value on its slider, and the value at a place with four digits. */
const placeOf = (slider, value) => {
  const [low, high, at] = slider.logarithmic ? [slider.low, slider.high, value].map(Math.log) : [slider.low, slider.high, value];
  return Math.round((STEPS * (at - low)) / (high - low));
};
const valueAt = (slider, place) => {
  const share = place / STEPS;
  const value = slider.logarithmic
    ? slider.low * (slider.high / slider.low) ** share
    : slider.low + (slider.high - slider.low) * share;
  return Math.abs(value) < 1e-9 * Math.abs(slider.high) ? 0 : Number(value.toPrecision(4));
};

/** Write the numbers that differ from the scenario into the address. */
function remember() {
  const words = sliders.filter(({ key, value }) => state.values[key] !== value).map(({ key }) => [key, state.values[key]]);
  if (state.share !== 0.1) words.push(["share", state.share]);
  for (const name of SHOWN) if (state[name]) words.push([name, 1]);
  history.replaceState(null, "", `${location.pathname}#${new URLSearchParams(words)}`);
  $("reset").disabled = words.length === 0;
}

/** Read the numbers of the address, and the token, which does not stay in it. */
function recall() {
  const words = new URLSearchParams(location.hash.slice(1));
  if (words.get("token")) token = words.get("token");
  try {
    if (token) sessionStorage.setItem("token", token);
    else token = sessionStorage.getItem("token") || "";
  } catch {
    // a frame may have no storage
  }
  for (const { key, value } of sliders) state.values[key] = words.has(key) ? words.get(key) : value;
  for (const { key } of sliders) {
    const number = Number(state.values[key]);
    if (state.values[key] !== "" && Number.isFinite(number)) state.values[key] = number;
  }
  const share = Number(words.get("share"));
  if (share > 0 && share < 1) state.share = share;
  for (const name of SHOWN) state[name] = words.get(name) === "1";
}

/** Keep the state before a gesture, so that it can be undone. */
function keep() {
  undone.push(JSON.stringify(state));
  $("undo").disabled = false;
}

function restore(text) {
  Object.assign(state, JSON.parse(text));
  settle();
}

/** Show the state everywhere, after a gesture. */
function settle() {
  remember();
  showControls();
  draw().then(tell);
}

// Sliders

function build(slider) {
  const box = element("div", "", { class: "slider" });
  const label = element("label", `${slider.marked ? "★ " : ""}${slider.meaning}${slider.symbol ? ", " : ""}`, { for: slider.key });
  const [letter, index] = slider.symbol.split("_");
  label.append(GREEK[letter] || letter, element("sub", index || ""), " ", element("small", slider.key));
  const range = element("input", "", { type: "range", id: slider.key, min: 0, max: STEPS, step: 1 });
  const text = element("input", "", { type: "text", id: `text ${slider.key}`, "aria-label": `${slider.meaning}, with its unit`, autocomplete: "off", spellcheck: "false" });
  let gesture = false;
  range.addEventListener("input", () => {
    if (!gesture) keep();
    gesture = true;
    touched = slider.key;
    ran = null;
    blame(slider.key, "");
    state.values[slider.key] = valueAt(slider, Number(range.value));
    draw();
  });
  range.addEventListener("change", () => {
    gesture = false;
    remember();
    tell();
  });
  text.addEventListener("change", () => read(slider, text).catch((fault) => complain(String(fault.message))));
  const track = element("div", "", { class: "track" });
  track.append(range);
  box.append(label, track, text);
  if (slider.over_wavelength) {
    const choice = element("select", "", { id: "meaning", "aria-label": "What the length is" });
    choice.append(element("option", "correlation length", { value: "" }), element("option", "wavelength of the same energy", { value: "1" }));
    choice.addEventListener("change", () => showControls(shown.values));
    label.append(" ", choice);
  }
  $("sliders").append(box);
}

/** Return the text of a slider's value; of a length as a wavelength if that was chosen. */
function textOf(slider, [value, text]) {
  if (!slider.over_wavelength || !$("meaning").value) return text;
  return `${Number((1e6 * value) / slider.over_wavelength).toPrecision(4)} µm`;
}

/** Read a text with a unit; one that cannot be read leaves the last value and says why. */
async function read(slider, text) {
  const key = slider.key;
  const answer = await ask("/curves", { values: { ...state.values, [key]: text.value }, share: state.share });
  if (answer.faults) return blame(key, answer.faults[key] || answer.faults[""]);
  blame(key, "");
  keep();
  touched = key;
  ran = null;
  state.values[key] = answer.values[key][0] * (slider.over_wavelength && $("meaning").value ? slider.over_wavelength : 1);
  text.value = textOf(slider, [state.values[key], answer.values[key][1]]);
  settle();
}

/** Show why a text was refused, or that it no longer is. */
function blame(key, reason) {
  const text = $(`text ${key}`);
  const old = $(`fault ${key}`);
  if (old) old.remove();
  text.setAttribute("aria-invalid", String(Boolean(reason)));
  if (reason) text.parentElement.append(element("p", `“${text.value}” ${reason}; the value before is kept`, { id: `fault ${key}`, class: "fault", role: "alert" }));
}

/** Bring all inputs to the state. */
function showControls(texts = {}) {
  for (const slider of sliders) {
    const range = $(slider.key);
    const text = $(`text ${slider.key}`);
    if (document.activeElement !== range) range.value = placeOf(slider, state.values[slider.key]);
    if (texts[slider.key]) {
      const words = textOf(slider, texts[slider.key]);
      range.setAttribute("aria-valuetext", words);
      if (document.activeElement !== text && text.getAttribute("aria-invalid") !== "true") text.value = words;
    }
  }
  $("level").value = Math.round(100 * state.share);
  $("level").setAttribute("aria-valuetext", `${Math.round(100 * state.share)} %`);
  for (const name of SHOWN) $(name).checked = state[name];
  $("undo").disabled = undone.length === 0;
}

// Curves

const draw = latest(async () => {
  show(await ask("/curves", { values: state.values, share: state.share, loads: state.loads, data: table }));
  follow();
});

const follow = latest(async () => {
  if (slow) return;
  const values = { ...state.values };
  const band = await ask("/band", { values });
  if (Object.keys(values).some((key) => values[key] !== state.values[key])) return;
  slow = !band.along && !band.faults;
  own = band.along ? band : null;
  paint();
});

const tell = latest(async () => {
  const { diagnosis, remarks, faults } = await ask("/words", { values: state.values });
  if (faults) {
    complain(Object.values(faults).join("; "));
    return;
  }
  for (const [id, lines] of Object.entries({ diagnosis, remarks })) $(id).replaceChildren(...lines.map((line) => element("li", line)));
  const speed = shown.level.speeds[0] || shown.speed[Math.floor(shown.speed.length / 2)];
  paintContact(await ask("/contact", { values: state.values, speed }));
});

/** Show an answer, or why its values were refused: then the last good ones stay. */
function show(answer) {
  if (answer.faults) {
    for (const [key, reason] of Object.entries(answer.faults)) {
      const at = key in state.values ? key : touched;
      if (!$(`text ${at}`)) continue;
      blame(at, reason);
      if (shown) state.values[at] = shown.values[at][0];
    }
    showControls();
    return;
  }
  complain("");
  shown = answer;
  ghost = ghost || answer;
  showControls(answer.values);
  $("lost").textContent = answer.level.words;
  judge(answer.data);
  paint();
}

const ink = () => (dark.matches ? "#e8e8e8" : "#1a1a1a");
const times = (values, factor) => values.map((value) => (value === null ? null : value * factor));
const plus = (one, other) => one.map((value, k) => (value === null || other[k] === null ? null : value + other[k]));

/** Return factor and unit of a quantity of the curves; of a share they are per cent. */
const unitOf = (name) => shown.units[name] || [100, "%"];
const sized = () => (state.absolute ? "contact_area" : "area_ratio");

/** Return a trace of a quantity over the speed. */
function line(answer, name, words, axis, more = {}) {
  const [factor, unit] = unitOf(name);
  return {
    x: times(answer.speed || shown.speed, shown.units.speed[0]), y: times(answer.curves[name], factor), name: words, yaxis: axis,
    mode: "lines", hovertemplate: `%{y:.4~g} ${unit}`, ...more, line: { ...more.line, simplify: false },
  };
}

/** Return the traces of the area: what is left, and above it what each mechanism takes. */
function areas(answer) {
  const { curves } = answer;
  const [factor, unit] = unitOf(sized());
  const left = times(curves[sized()], factor);
  const whole = left.map((value, k) => (curves.area_ratio[k] ? value / curves.area_ratio[k] : null));
  const swap = state.first && curves.lost_to_bonds_last;
  const bonds = [swap ? "lost_to_bonds_last" : "lost_to_bonds", "lost to bonds", COLOURS.bonds];
  const waves = [swap ? "lost_to_fluctuations_first" : "lost_to_fluctuations", "lost to fluctuations", COLOURS.fluctuations];
  const taken = [["lost_to_mean_stress", "lost to the mean stress", COLOURS.stress], ...(swap ? [bonds, waves] : [waves, bonds])];
  let level = left;
  const result = [line(answer, sized(), "area", "y", { line: { color: ink(), width: 2.5 } })];
  for (const [name, words, colour] of taken.filter(([key]) => curves[key])) {
    const loss = curves[name].map((value, k) => (value === null || whole[k] === null ? null : value * whole[k]));
    level = plus(level, loss);
    result.push(line(answer, sized(), words, "y", {
      y: level, customdata: loss, fill: "tonexty", fillcolor: `${colour}59`, line: { color: colour, width: 1 }, hovertemplate: `%{customdata:.3~g} ${unit}`,
    }));
  }
  return result;
}

/** Return the traces of a run of the scenario's own models over the speed: means with their intervals. */
function ofRun(run, name, axis, words) {
  const { mean, low, high } = run.curves[name];
  const still = run.speed.length < 3;
  const x = times(run.speed, shown.units.speed[0]);
  const [factor, unit] = unitOf(name);
  const rest = { x, yaxis: axis, hoverinfo: "skip", hovertemplate: null, showlegend: false };
  const look = { color: COLOURS.own, width: 2, dash: "dash" };
  const middle = {
    x, y: times(mean, factor), yaxis: axis, name: words, mode: still ? "markers" : "lines", line: look, marker: { color: COLOURS.own, size: 9 },
    hovertemplate: `%{y:.4~g} ${unit}`, showlegend: axis === "y",
  };
  if (still) middle.error_y = { type: "data", symmetric: false, array: plus(times(high, factor), times(mean, -factor)), arrayminus: plus(times(mean, factor), times(low, -factor)) };
  const edge = (values, more) => ({ ...rest, y: times(values, factor), mode: "lines", line: { width: 0 }, ...more });
  return still ? [middle] : [edge(low, {}), edge(high, { fill: "tonexty", fillcolor: `${COLOURS.own}33` }), middle];
}

/** Return the traces of measured points. */
function measured(data) {
  const drawn = [[sized(), "y"], ["friction_force", "y3"]].filter(([name]) => data.points[name]);
  return drawn.map(([name, axis]) => {
    const { speed, values, errors } = data.points[name];
    const [factor, unit] = unitOf(name);
    return {
      x: times(speed, shown.units.speed[0]), y: times(values, factor), yaxis: axis, name: "measured", mode: "markers",
      marker: { color: ink(), size: 7, symbol: "circle-open", line: { width: 1.5 } }, showlegend: axis === "y",
      error_y: { type: "data", array: times(errors, factor), color: ink(), thickness: 1 }, hovertemplate: `%{y:.4~g} ${unit}`,
    };
  });
}

function paint() {
  const { level, units } = shown;
  const dotted = { line: { color: COLOURS.rest, dash: "dot", width: 1.5 }, hoverinfo: "skip", hovertemplate: null, showlegend: false };
  const all = [...areas(shown), line(ghost, sized(), "area before", "y", dotted)];
  all.push(line(shown, "work_of_adhesion", "work of adhesion w", "y2", { line: { color: ink(), width: 2 } }));
  all.push(line(shown, "fluctuation_energy", "energy ΔΓ", "y2", { line: { color: COLOURS.fluctuations, width: 2 } }));
  all.push(line(shown, "friction_force", "friction F", "y3", { line: { color: ink(), width: 2 }, showlegend: false }));
  all.push(line(ghost, "friction_force", "friction before", "y3", dotted));
  for (const { load, curves } of shown.loads || []) {
    const grey = { line: { color: COLOURS.rest, width: 1.5, dash: "dashdot" } };
    all.push(line({ curves }, sized(), `area at ${load}`, "y", grey), line({ curves }, "friction_force", `F at ${load}`, "y3", { ...grey, showlegend: false }));
  }
  const run = ran || own;
  if (run && run.along === "speed") all.push(...ofRun(run, sized(), "y", run.members > 1 ? `own models, mean of ${run.members} members` : "own models"), ...ofRun(run, "friction_force", "y3", "own models"));
  if (shown.data) all.push(...measured(shown.data));
  const traces = narrow.matches ? all.filter((trace) => trace.yaxis === "y") : all;
  const axis = { gridcolor: dark.matches ? "#33363b" : "#e4e4e4", zeroline: false, fixedrange: true, automargin: true };
  const title = (text) => ({ text, font: { size: 13 } });
  const marks = level.speeds.map((speed) => ({
    type: "line", x0: speed * units.speed[0], x1: speed * units.speed[0], y0: 0, y1: 1, yref: "paper", line: { color: COLOURS.rest, width: 1, dash: "dash" },
  }));
  Plotly.react($("plot"), traces, {
    ...base(), height: narrow.matches ? 300 : 620, margin: { l: 60, r: 12, t: 8, b: 44 }, showlegend: true,
    legend: { orientation: "h", traceorder: "normal", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12 } },
    hovermode: "x unified", hoversubplots: "axis", shapes: marks, hoverlabel: { bgcolor: dark.matches ? "#16181b" : "#ffffff" },
    xaxis: { ...axis, type: "log", title: title(`sliding speed (${units.speed[1]})`), anchor: narrow.matches ? "y" : "y3", unifiedhovertitle: { text: `V = %{x:.4~g} ${units.speed[1]}` } },
    yaxis: { ...axis, title: title(state.absolute ? `contact area (${units.contact_area[1]})` : "area over JKR's (%)"), domain: narrow.matches ? [0, 1] : [0.5, 1] },
    yaxis2: { ...axis, title: title(`w, ΔΓ (${units.work_of_adhesion[1]})`), domain: [0.25, 0.46], visible: !narrow.matches },
    yaxis3: { ...axis, title: title(`F (${units.friction_force[1]})`), domain: [0, 0.21], visible: !narrow.matches, rangemode: "tozero" },
  }, { displayModeBar: false, responsive: true });
  paintTrace(run);
}

const base = () => ({ paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink(), size: 13 }, dragmode: false });

/** Draw friction and area of one member over time, where the speed is no axis. */
function paintTrace(run) {
  const hasTrace = Boolean(run && run.along === "t");
  $("trace").hidden = !hasTrace;
  if (!hasTrace) return;
  const axis = { gridcolor: dark.matches ? "#33363b" : "#e4e4e4", zeroline: false, fixedrange: true, automargin: true };
  const trace = (name, words, yaxis) => {
    const [factor, unit] = unitOf(name);
    return { x: run.t, y: times(run.curves[name].mean, factor), name: words, yaxis, mode: "lines", line: { color: ink(), width: 1.5 }, hovertemplate: `%{y:.4~g} ${unit}`, showlegend: false };
  };
  Plotly.react($("trace"), [trace("friction_force", "friction F", "y"), trace(sized(), "area", "y2")], {
    ...base(), height: 320, margin: { l: 60, r: 12, t: 8, b: 44 }, hovermode: "x unified", hoversubplots: "axis",
    xaxis: { ...axis, title: { text: "time (s)" }, anchor: "y2" },
    yaxis: { ...axis, title: { text: `F (${unitOf("friction_force")[1]})` }, domain: [0.54, 1] },
    yaxis2: { ...axis, title: { text: state.absolute ? `area (${unitOf("contact_area")[1]})` : "A/A_JKR (%)" }, domain: [0, 0.46] },
  }, { displayModeBar: false, responsive: true });
}

/** Draw the sphere on the half-space from the side, to scale, and the contact from above. */
function paintContact(found) {
  const { radius, speed } = found;
  const micro = 1e6;
  $("scene").textContent = radius
    ? `At ${(speed * shown.units.speed[0]).toPrecision(3)} ${shown.units.speed[1]}: contact radius ${(radius * micro).toPrecision(4)} µm. Above: a cut through sphere and half-space, heights and widths to one scale. Below: the contact circle${found.stress ? " on a map of one realisation of the shear stress" : ""}; dotted: JKR's circle.`
    : "The contact is open.";
  $("contact").hidden = !radius;
  if (!radius) return;
  const half = (found.side * micro) / 2;
  const x = times(found.x, micro);
  const circle = (size, look) => ({ type: "circle", xref: "x", yref: "y2", x0: -size, x1: size, y0: -size, y1: size, line: { color: ink(), ...look } });
  const shapes = [circle(radius * micro, { width: 2 })];
  if (found.jkr_radius) shapes.push(circle(found.jkr_radius * micro, { width: 1, dash: "dot" }));
  const traces = [
    { x, y: times(found.surface, micro), mode: "lines", line: { color: COLOURS.rest, width: 2 }, name: "half-space", hoverinfo: "skip" },
    { x, y: times(found.sphere, micro), mode: "lines", line: { color: ink(), width: 2 }, name: "sphere", hoverinfo: "skip" },
  ];
  if (found.stress) {
    const ends = times(found.stress.flat().slice().sort((one, other) => one - other), 1e-3);
    const most = Math.max(Math.abs(ends[0]), Math.abs(ends[ends.length - 1]));
    traces.push({
      type: "heatmap", z: found.stress[0].map((_, k) => times(found.stress.map((row) => row[k]), 1e-3)), x0: -half, dx: (2 * half) / found.stress.length,
      y0: -half, dy: (2 * half) / found.stress.length, xaxis: "x", yaxis: "y2", colorscale: "RdBu", zmin: -most, zmax: most,
      colorbar: { title: { text: "stress (kPa)" }, len: 0.66, y: 0.33, thickness: 12 }, hovertemplate: "%{z:.3~g} kPa<extra></extra>",
    });
  }
  const axis = { zeroline: false, fixedrange: true, showgrid: false, range: [-half, half] };
  const width = Math.min($("words").clientWidth, 460);
  Plotly.react($("contact"), traces, {
    ...base(), width, height: 1.45 * width, margin: { l: 60, r: 12, t: 8, b: 44 }, showlegend: false, shapes,
    xaxis: { ...axis, title: { text: "along the sliding direction (µm)" }, anchor: "y2", constrain: "domain" },
    yaxis: { zeroline: false, fixedrange: true, showgrid: false, title: { text: "height (µm)" }, domain: [0.74, 1], scaleanchor: "x" },
    yaxis2: { ...axis, title: { text: "across (µm)" }, domain: [0, 0.66], scaleanchor: "x", constrain: "domain" },
  }, { displayModeBar: false });
}

// The scenario's own models, and fits: jobs whose stream of answers is the job

let stop = null;

/** Run a job; ``take`` gets its result. To stop, or to leave the page, ends it. */
async function job(request, take) {
  if (stop) stop.abort();
  stop = new AbortController();
  $("stop").disabled = false;
  $("progress").hidden = false;
  $("progress").value = 0;
  $("ran").textContent = "";
  try {
    const answer = await post("/run", request, stop.signal);
    if (!answer.headers.get("content-type").includes("ndjson")) {
      const { message, faults } = await answer.json();
      throw new Error(message || Object.values(faults).join("; "));
    }
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let text = ""; ; ) {
      const { value, done } = await reader.read();
      if (done) break;
      const lines = (text + value).split("\n");
      text = lines.pop();
      for (const message of lines.map((each) => JSON.parse(each))) {
        if (message.done !== undefined) $("progress").value = message.done;
        if (message.left !== undefined) $("ran").textContent = `${message.left} left`;
        if (message.fault) throw new Error(message.fault);
        if (message.result) take(message.result);
      }
    }
  } catch (fault) {
    $("ran").textContent = fault.name === "AbortError" ? "stopped" : String(fault.message);
  } finally {
    $("stop").disabled = true;
    $("progress").hidden = true;
  }
}

$("own").addEventListener("submit", (event) => {
  event.preventDefault();
  job({ task: "ensemble", values: state.values, members: Number($("members").value) }, (result) => {
    ran = result;
    $("ran").textContent = result.along === "t" ? "first member, below" : `${result.members} members: mean and 95 % interval in the figure`;
    paint();
  });
});
$("stop").addEventListener("click", () => stop && stop.abort());

// Measured curves

async function load(file) {
  try {
    const { data } = await ask("/data", { name: file.name, text: await file.text() });
    useTable(data);
    draw();
  } catch (fault) {
    $("judged").hidden = false;
    $("judged").textContent = String(fault.message);
  }
}

/** Show a table from now on, and offer the numbers that can be fitted to it. */
function useTable(digest) {
  table = digest;
  $("fitted").hidden = true;
  for (const { key } of sliders) mark(key, NaN, NaN);
  $("free").replaceChildren($("free").firstElementChild, ...sliders.map(({ key }) => {
    const label = element("label");
    label.append(element("input", "", { type: "checkbox", value: key }), ` ${key}`);
    return label;
  }));
  $("free").hidden = $("fit").disabled = false;
}

/** Draw the 95 % interval of a fitted number on its slider, or take it away. */
function mark(key, low, high) {
  const track = $(key).parentElement;
  track.querySelectorAll("svg").forEach((old) => old.remove());
  if (!Number.isFinite(low) || !Number.isFinite(high)) return;
  const slider = sliders.find((each) => each.key === key);
  const [from, to] = [low, high].map((end) => Math.min(STEPS, Math.max(0, placeOf(slider, end))));
  const draw = (name, attributes) => {
    const part = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [word, value] of Object.entries(attributes)) part.setAttribute(word, value);
    return part;
  };
  const picture = draw("svg", { viewBox: `0 0 ${STEPS} 4`, preserveAspectRatio: "none", role: "img", "aria-label": "95 % interval of the fit" });
  picture.append(draw("rect", { x: from, y: 0, width: Math.max(2, to - from), height: 4 }));
  track.append(picture);
}

/** State how well the curves fit the points. */
function judge(data) {
  if (!data) return;
  const worst = Object.values(data.points).flatMap(({ residuals }) => residuals).filter((value) => value !== null).map(Math.abs);
  const far = worst.length ? `, largest residual ${Math.max(...worst).toPrecision(2)} standard errors` : "";
  $("judged").hidden = false;
  $("judged").textContent = data.count ? `${data.name}: χ² = ${data.chi_square.toPrecision(4)} for ${data.count} numbers${far}` : `${data.name}: without errors there is no χ²`;
}

$("file").addEventListener("change", () => $("file").files[0] && load($("file").files[0]));
$("data").addEventListener("submit", (event) => {
  event.preventDefault();
  const free = [...$("free").querySelectorAll("input:checked")].map(({ value }) => value);
  if (!free.length) return void ($("ran").textContent = "tick the numbers to fit");
  job({ task: "fit", values: state.values, data: table, free }, ({ numbers, text, remarks }) => {
    keep();
    for (const [key, { value, low, high }] of Object.entries(numbers)) {
      state.values[key] = value;
      mark(key, low, high);
    }
    $("fitted").hidden = false;
    $("fitted").textContent = [text, ...remarks].join("\n");
    settle();
  });
});
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
addEventListener("dragleave", () => document.body.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  if (event.dataTransfer.files[0]) load(event.dataTransfer.files[0]);
});

// What is taken away

$("take").addEventListener("change", async () => {
  const kind = $("take").value;
  $("take").value = "";
  try {
    const name = `explored.${kind}`;
    const isText = kind === "toml" || kind === "csv";
    const content = isText ? (await ask(`/${kind}`, { values: state.values })).text : await ask("/picture", { values: state.values, kind });
    const link = element("a", "", { download: name });
    link.href = URL.createObjectURL(new Blob([content]));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  } catch (fault) {
    complain(String(fault.message));
  }
});

// Start

const drawable = new Promise((ready) => $("plotly").addEventListener("load", ready));

/** Ask for the sliders and the curves while the browser still reads plotly. */
async function begin() {
  recall();
  if (!token) return complain("This page has lost its key. Open the address that sim explore printed.");
  const { title, sliders: known, preview, data } = await ask("/start", {});
  $("title").textContent = document.title = title;
  ghost = await ask("/curves", { values: {}, share: state.share });
  await drawable; // before there is a slider to move
  sliders = known;
  sliders.forEach(build);
  if (preview.length) {
    $("preview").hidden = false;
    $("preview").textContent = `Preview: steady sliding is not what this scenario computes, because ${preview.join(", and ")}. Run the scenario's own models below.`;
  }
  if (data) useTable(data);
  recall();
  settle();
}

$("undo").addEventListener("click", () => {
  restore(undone.pop());
});
$("reset").addEventListener("click", () => {
  keep();
  restore(JSON.stringify({ values: Object.fromEntries(sliders.map(({ key, value }) => [key, value])), share: 0.1, absolute: false, first: false, loads: false }));
});
let levelling = false;
$("level").addEventListener("input", () => {
  if (!levelling) keep();
  levelling = true;
  state.share = Number($("level").value) / 100;
  draw();
});
$("level").addEventListener("change", () => {
  levelling = false;
  remember();
});
for (const name of SHOWN) {
  $(name).addEventListener("change", () => {
    keep();
    state[name] = $(name).checked;
    settle();
  });
}
$("view").addEventListener("submit", (event) => event.preventDefault());
addEventListener("hashchange", () => {
  recall();
  settle();
});
dark.addEventListener("change", () => shown && paint());
narrow.addEventListener("change", () => shown && paint());
begin().catch((fault) => complain(String(fault.message || fault)));
