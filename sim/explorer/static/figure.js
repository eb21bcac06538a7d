// Figures as SVG: axes, lines, bands, points and labels.

import { h } from "./node.js";

/** @typedef {import("./node.js").Node} Node */
/** @typedef {{ label: string, low: number, high: number, log: boolean }} Axis */
/** @typedef {(number | null)[]} Numbers */
/** What a panel shows: `line`, `band` (between `y` and `high`), `points` (with errors), `rule` (at the places `x`), and
 * `image` (of the address `name` between the ends `x` and `y`).
 * @typedef {{ kind: "line" | "band" | "points" | "rule" | "image", x: Numbers, y: Numbers, high?: Numbers, colour: string,
 *   width?: number, size?: number, dash?: string, opacity?: number, label?: string, name?: string, title?: string }} Mark */
/** @typedef {{ x: Axis, y: Axis, height: number, marks: Mark[] }} Panel */
/** @typedef {{ ink: string, soft: string, grid: string, back: string }} Theme */

const FONT = "system-ui, sans-serif";
const [LEFT, TOP, BOTTOM, GAP, LINE] = [70, 8, 40, 12, 14];

/** Return a line of a figure.
 * @param {string} d
 * @param {Node["attributes"]} look */
export const path = (d, look) => h("path", { d, fill: "none", ...look });

/** Return a text of a figure.
 * @param {string} words
 * @param {number} x
 * @param {number} y
 * @param {Node["attributes"]} look */
export const label = (words, x, y, look = {}) => h("text", { x: x.toFixed(1), y: y.toFixed(1), ...look }, words);

/** @param {Numbers} values
 * @returns {number[]} */
const known = (values) => /** @type {number[]} */ (values.filter((value) => value !== null));

/** Return an axis that holds all numbers. A linear one reaches over zero if that is wanted, and over a least span.
 * @param {string} label
 * @param {Numbers[]} each
 * @param {{ log?: boolean, zero?: boolean, tight?: boolean }} choices
 * @returns {Axis} */
export function axisOf(label, each, { log = false, zero = false, tight = false } = {}) {
  let [low, high] = [zero ? 0 : Infinity, zero ? 0 : -Infinity];
  for (const values of each) {
    for (const value of values) {
      if (value === null || (log && value <= 0)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!(low <= high)) [low, high] = log ? [0.1, 1] : [0, 1];
  if (log) {
    const edge = tight ? 1 : (high / low) ** 0.03;
    return { label, low: low / edge, high: high > low ? high * edge : 10 * low, log };
  }
  // noise smaller than a twentieth of the number does not fill a panel
  const least = 0.05 * Math.max(Math.abs(low), Math.abs(high)) || 1;
  const missing = Math.max(0, least - (high - low)) / 2;
  const pad = tight && !missing ? 0 : 0.04 * (high - low);
  const isAtZero = zero && low === 0;
  return { label, low: isAtZero ? 0 : low - missing - pad, high: high + missing + pad, log };
}

/** Return the labelled ticks of an axis, about `count`, and the small ones between.
 * @param {Axis} axis
 * @param {number} count
 * @returns {{ large: number[], small: number[] }} */
export function ticks({ low, high, log }, count) {
  if (log) {
    const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    const decades = Array.from({ length: last - first + 1 }, (_, k) => Number(`1e${first + k}`));
    const within = (/** @type {number} */ value) => value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9);
    const every = (/** @type {number[]} */ digits) =>
      decades.flatMap((decade) => digits.map((digit) => Number((digit * decade).toPrecision(3)))).filter(within);
    const few = every([1]);
    const skip = Math.ceil(few.length / count);
    const large = few.length > 2 ? few.filter((_, k) => k % skip === 0) : every([1, 2, 5]);
    return { large, small: every([1, 2, 3, 4, 5, 6, 7, 8, 9]) };
  }
  const rough = (high - low) / Math.max(1, count);
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * ([1, 2, 2.5, 5, 10].find((digit) => digit * size >= rough * 0.999) ?? 10);
  const between = (/** @type {number} */ width) => {
    const first = Math.ceil(low / width - 1e-9) + 0; // no −0
    const length = Math.floor(high / width + 1e-9) - first + 1;
    return Array.from({ length: Math.max(0, length) }, (_, k) => Number(((first + k) * width).toPrecision(12)));
  };
  return { large: between(step), small: between(step / (step / size === 2 ? 4 : 5)) };
}

/** Return a number of an axis as text.
 * @param {number} value */
export function ticked(value) {
  const size = Math.abs(value);
  if (value === 0 || (size >= 1e-3 && size < 1e5)) return String(Number(value.toPrecision(6))).replace("-", "−");
  const power = Math.floor(Math.log10(size) + 1e-9);
  const raised = [...String(power)].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");
  const factor = Number((value / 10 ** power).toPrecision(4));
  return factor === 1 ? `10${raised}` : `${String(factor).replace("-", "−")}·10${raised}`;
}

/** Return the place of a number between two ends of a picture.
 * @param {Axis} axis
 * @param {number} from
 * @param {number} to
 * @returns {(value: number) => number} */
export function placed({ low, high, log }, from, to) {
  if (!log) return (value) => from + ((to - from) * (value - low)) / (high - low);
  const [first, last] = [Math.log(low), Math.log(high)];
  return (value) => from + ((to - from) * (Math.log(value) - first)) / (last - first);
}

/** Return the points of a line, in pixels. Of many points that share a column of pixels the first, the least, the
 * largest and the last stay, so that no extreme is lost.
 * @param {Numbers} x
 * @param {Numbers} y
 * @param {(value: number) => number} right
 * @param {(value: number) => number} up
 * @returns {[number, number][][]} */
export function strokes(x, y, right, up) {
  /** @type {[number, number][][]} */
  const result = [];
  /** @type {[number, number][]} */
  let run = [];
  /** @type {[number, number][]} */
  let column = [];
  const leave = () => {
    const heights = column.map(([, height]) => height);
    const few = [0, heights.indexOf(Math.min(...heights)), heights.indexOf(Math.max(...heights)), heights.length - 1];
    const places = [...new Set(x.length < 1000 ? heights.keys() : few)].sort((one, other) => one - other);
    run.push(...places.filter((place) => place in column).map((place) => column[place]));
    column = [];
  };
  for (let place = 0; place < x.length; place += 1) {
    const [across, along] = [x[place], y[place]];
    if (across === null || along === null || !Number.isFinite(right(across))) {
      leave();
      if (run.length) result.push(run);
      run = [];
      continue;
    }
    /** @type {[number, number]} */
    const point = [right(across), up(along)];
    if (column.length && Math.floor(column[0][0]) !== Math.floor(point[0])) leave();
    column.push(point);
  }
  leave();
  if (run.length) result.push(run);
  return result;
}

/** @param {[number, number][]} points */
const joined = (points) => points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L");

/** Return what is drawn of a mark.
 * @param {Mark} mark
 * @param {(value: number) => number} right
 * @param {(value: number) => number} up
 * @param {number[]} ends
 * @returns {Node[]} */
function shapes(mark, right, up, [top, bottom]) {
  const { kind, x, y, high, colour, width = 2, dash = "", opacity = 1, name = "" } = mark;
  const look = { "data-name": name, stroke: colour, "stroke-width": width };
  if (kind === "image") {
    const [[left, end], [low, upper]] = [known(x).map(right), known(y).map(up)];
    const size = { x: left, y: upper, width: end - left, height: low - upper };
    return [h("image", { ...size, href: name, preserveAspectRatio: "none" })];
  }
  if (kind === "rule") {
    const lines = known(x).map((at) => `M${right(at).toFixed(1)} ${top}V${bottom}`);
    return lines.length ? [path(lines.join(""), { ...look, "stroke-dasharray": dash || "6 4" })] : [];
  }
  if (kind === "band") {
    const [low, upper] = [strokes(x, y, right, up), strokes(x, high ?? y, right, up)];
    const area = { "data-name": name, fill: colour, "fill-opacity": opacity };
    return low.map((points, k) => ({
      ...path(`M${joined(points)}L${joined([...(upper[k] ?? points)].reverse())}Z`, area),
      children: mark.title ? [h("title", {}, mark.title)] : [],
    }));
  }
  if (kind === "line") {
    const lines = strokes(x, y, right, up).map((points) => `M${joined(points)}${points.length === 1 ? "h.1" : ""}`);
    const ends = { "stroke-linejoin": "round", "stroke-linecap": "round" };
    const strength = { "stroke-dasharray": dash, "stroke-opacity": opacity };
    return lines.length ? [path(lines.join(""), { ...look, ...ends, ...strength })] : [];
  }
  return x.flatMap((at, k) => {
    const value = y[k];
    if (at === null || value === null || !Number.isFinite(right(at))) return [];
    const [across, along, error] = [right(at).toFixed(1), up(value).toFixed(1), high?.[k] ?? 0];
    const dot = h("circle", { ...look, cx: across, cy: along, r: mark.size ?? 3.5, fill: "none" });
    if (!error) return [dot];
    return [
      path(`M${across} ${up(value - error).toFixed(1)}V${up(value + error).toFixed(1)}`, { stroke: colour }),
      dot,
    ];
  });
}

/** Return where labels at the ends of curves stand, so that none hides another.
 * @param {{ at: number }[]} labels
 * @param {number} top
 * @param {number} bottom */
export function spread(labels, top, bottom) {
  const places = labels.map(({ at }) => at);
  for (let k = 0; k < places.length; k += 1) places[k] = Math.max(places[k], k ? places[k - 1] + LINE : top);
  for (let k = places.length - 1, limit = bottom; k >= 0; k -= 1) {
    places[k] = Math.min(places[k], limit);
    limit = places[k] - LINE;
  }
  return places;
}

/** @param {Mark[]} marks
 * @param {Theme} theme
 * @param {(value: number) => number} up
 * @returns {{ text: string, colour: string, at: number }[]} */
function endings(marks, theme, up) {
  return marks
    .filter(({ label }) => label)
    .flatMap((mark) => {
      const place = mark.y.findLastIndex((value) => value !== null);
      if (place < 0) return [];
      const value = /** @type {number} */ (mark.y[place]);
      const high = mark.kind === "band" ? (mark.high?.[place] ?? value) : value;
      // letters need more contrast than a line, so that they are in ink beside a stroke of the line's colour
      return [
        { text: /** @type {string} */ (mark.label), colour: mark.colour || theme.ink, at: up((value + high) / 2) },
      ];
    })
    .sort((one, other) => one.at - other.at);
}

/** Return the places in a figure of the panels' ends: left, right, and top and bottom of each; and the figure's height.
 * @param {Panel[]} panels
 * @param {number} width
 * @param {boolean} shared */
export function frames(panels, width, shared = true) {
  const longest = Math.max(0, ...panels.flatMap(({ marks }) => marks.map(({ label }) => label?.length ?? 0)));
  const right = width - Math.min(width * 0.4, longest ? 6.9 * longest + 28 : 14);
  let top = TOP;
  const rows = panels.map(({ height }) => {
    const row = [top, top + height];
    top += height + (shared ? GAP : GAP + BOTTOM);
    return row;
  });
  const height = (rows.at(-1)?.[1] ?? TOP) + BOTTOM;
  return { left: LEFT, right, rows, height };
}

/** Return a figure of panels above each other. Names of its parts begin with `id`, one for each figure of a page.
 * @param {Panel[]} panels
 * @param {{ width: number, theme: Theme, title: string, description: string, shared?: boolean, id?: string }} about
 * @returns {Node} */
export function figure(panels, { width, theme, title, description, shared = true, id = "figure" }) {
  const { left, right, rows, height } = frames(panels, width, shared);
  const parts = panels.flatMap((panel, k) => {
    const hasLabels = !shared || k === panels.length - 1;
    return panelOf(panel, { ends: [left, right], row: rows[k], theme, clip: `${id}-panel-${k}`, hasLabels });
  });
  const about = { role: "img", "aria-labelledby": `${id}-title ${id}-words` };
  const size = { viewBox: `0 0 ${width} ${height}`, width, height };
  return h(
    "svg",
    { xmlns: "http://www.w3.org/2000/svg", ...size, ...about, "font-family": FONT, "font-size": 12, fill: theme.ink },
    h("title", { id: `${id}-title` }, title),
    h("desc", { id: `${id}-words` }, description),
    h("rect", { width, height, fill: theme.back }),
    ...parts,
  );
}

/** @param {Panel} panel
 * @param {{ ends: number[], row: number[], theme: Theme, clip: string, hasLabels: boolean }} about
 * @returns {Node[]} */
function panelOf({ x, y, marks }, { ends: [left, right], row: [top, bottom], theme, clip, hasLabels }) {
  const [across, along] = [placed(x, left, right), placed(y, bottom, top)];
  // an axis without a label is none
  const rows = y.label ? ticks(y, Math.max(2, (bottom - top) / 36)) : { large: [], small: [] };
  const columns = ticks(x, Math.max(2, (right - left) / 90));
  const at = (/** @type {number} */ value) => across(value).toFixed(1);
  const up = (/** @type {number} */ value) => along(value).toFixed(1);
  const grid = [
    ...columns.large.map((value) => `M${at(value)} ${top}V${bottom}`),
    ...rows.large.map((value) => `M${left} ${up(value)}H${right}`),
  ];
  // ticks point inwards on all four sides, as in the figures of sim plot
  const inward = [
    { ...columns, rows: rows.large, size: 5 },
    { large: columns.small, rows: rows.small, size: 3 },
  ].flatMap(({ large, rows: heights, size }) => [
    ...large.map((value) => `M${at(value)} ${bottom}v${-size}M${at(value)} ${top}v${size}`),
    ...heights.map((value) => `M${left} ${up(value)}h${size}M${right} ${up(value)}h${-size}`),
  ]);
  const size = { x: left, y: top, width: right - left, height: bottom - top };
  const frame = { stroke: theme.ink, "stroke-width": 0.8 };
  const [middle, names] = [{ "text-anchor": "middle" }, endings(marks, theme, along)];
  const places = spread(names, top + 6, bottom - 2);
  return [
    h("clipPath", { id: clip }, h("rect", size)),
    path(grid.join(""), { stroke: theme.grid }),
    h(
      "g",
      { "clip-path": `url(#${clip})`, class: "marks" },
      ...marks.flatMap((mark) => shapes(mark, across, along, [top, bottom])),
    ),
    path(inward.join(""), frame),
    h("rect", { ...size, fill: "none", ...frame }),
    h(
      "g",
      {},
      ...rows.large.map((value) => label(ticked(value), left - 6, along(value) + 4, { "text-anchor": "end" })),
      ...(hasLabels ? columns.large.map((value) => label(ticked(value), across(value), bottom + 16, middle)) : []),
      ...(hasLabels ? [label(x.label, (left + right) / 2, bottom + 33, { ...middle, class: "xtitle" })] : []),
      label(y.label, 0, 0, {
        ...middle,
        transform: `translate(15 ${(top + bottom) / 2}) rotate(-90)`,
        class: "ytitle",
      }),
      ...names.flatMap(({ text, colour, at: from }, k) => [
        path(`M${right} ${from.toFixed(1)}L${right + 8} ${places[k].toFixed(1)}h8`, {
          stroke: colour,
          "stroke-width": 2,
        }),
        label(text, right + 20, places[k] + 4),
      ]),
    ),
  ];
}
