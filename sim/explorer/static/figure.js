// Figures as SVG: axes, lines, bands, points and labels. A figure is first a tree of plain objects, so that it can be
// drawn, saved and tested alike.

/** @typedef {{ tag: string, attributes: Record<string, string | number>, children: (Node | string)[] }} Node */
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

/** Return an element of a figure.
 * @param {string} tag
 * @param {Record<string, string | number>} attributes
 * @param {(Node | string)[]} children
 * @returns {Node} */
export const h = (tag, attributes = {}, ...children) => ({ tag, attributes, children });

/** Return a figure as an element of the page.
 * @param {Node | string} node
 * @returns {globalThis.Node} */
export function built(node) {
  if (typeof node === "string") return document.createTextNode(node);
  const result = document.createElementNS("http://www.w3.org/2000/svg", node.tag);
  for (const [name, value] of Object.entries(node.attributes)) result.setAttribute(name, String(value));
  result.append(...node.children.map(built));
  return result;
}

/** Return a figure as the text of a file.
 * @param {Node | string} node
 * @returns {string} */
export function written(node) {
  const plain = (/** @type {string} */ text) =>
    text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");
  if (typeof node === "string") return plain(node);
  const words = Object.entries(node.attributes).map(([name, value]) => ` ${name}="${plain(String(value))}"`);
  return `<${node.tag}${words.join("")}>${node.children.map(written).join("")}</${node.tag}>`;
}

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
    if (column.length <= 4 || x.length < 1000) run.push(...column);
    else {
      const order = column.map(([, height], place) => [height, place]).sort((one, other) => one[0] - other[0]);
      const places = new Set([0, order[0][1], order[order.length - 1][1], column.length - 1]);
      run.push(...[...places].sort((one, other) => one - other).map((place) => column[place]));
    }
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

/** @param {Mark} mark
 * @param {(value: number) => number} right
 * @param {(value: number) => number} up
 * @param {[number, number]} ends
 * @returns {Node[]} */
function shapes(mark, right, up, ends) {
  const { x, y, colour, width = 2, dash = "", opacity = 1 } = mark;
  /** @type {Record<string, string>} */
  const about = mark.name ? { "data-name": mark.name } : {};
  const said = mark.title ? [h("title", {}, mark.title)] : [];
  if (mark.kind === "image") {
    const [left, end] = known(x).map(right);
    const [bottom, top] = known(y).map(up);
    return [
      h("image", {
        x: left,
        y: top,
        width: end - left,
        height: bottom - top,
        href: mark.name ?? "",
        preserveAspectRatio: "none",
      }),
    ];
  }
  if (mark.kind === "rule") {
    const path = known(x).map((at) => `M${right(at).toFixed(1)} ${ends[0]}V${ends[1]}`);
    return path.length
      ? [
          h("path", {
            ...about,
            d: path.join(""),
            stroke: colour,
            "stroke-width": width,
            "stroke-dasharray": dash || "6 4",
            fill: "none",
          }),
        ]
      : [];
  }
  if (mark.kind === "band") {
    const [low, high] = [strokes(x, y, right, up), strokes(x, mark.high ?? y, right, up)];
    return low.map((points, k) =>
      h(
        "path",
        {
          ...about,
          d: `M${joined(points)}L${joined([...(high[k] ?? points)].reverse())}Z`,
          fill: colour,
          "fill-opacity": opacity,
          stroke: "none",
        },
        ...said,
      ),
    );
  }
  if (mark.kind === "line") {
    const path = strokes(x, y, right, up).map((points) => `M${joined(points)}${points.length === 1 ? "h.1" : ""}`);
    const look = { stroke: colour, "stroke-width": width, "stroke-dasharray": dash, "stroke-opacity": opacity };
    return path.length
      ? [
          h("path", {
            ...about,
            d: path.join(""),
            fill: "none",
            "stroke-linejoin": "round",
            "stroke-linecap": "round",
            ...look,
          }),
        ]
      : [];
  }
  return x.flatMap((at, k) => {
    const value = y[k];
    if (at === null || value === null || !Number.isFinite(right(at))) return [];
    const [across, along] = [right(at), up(value)];
    const error = mark.high?.[k] ?? 0;
    const bar = h("path", {
      d: `M${across.toFixed(1)} ${up(value - error).toFixed(1)}V${up(value + error).toFixed(1)}`,
      stroke: colour,
    });
    const dot = h("circle", {
      ...about,
      cx: across.toFixed(1),
      cy: along.toFixed(1),
      r: mark.size ?? 3.5,
      fill: "none",
      stroke: colour,
      "stroke-width": width,
    });
    return error ? [bar, dot] : [dot];
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

/** Return the width that labels need.
 * @param {Panel[]} panels
 * @param {number} width */
export function rightOf(panels, width) {
  const longest = Math.max(0, ...panels.flatMap(({ marks }) => marks.map(({ label }) => label?.length ?? 0)));
  return Math.min(width * 0.4, longest ? 6.9 * longest + 28 : 14);
}

/** Return a figure of panels above each other.
 * @param {Panel[]} panels
 * @param {{ width: number, theme: Theme, title: string, description: string, shared?: boolean }} about
 * @returns {Node} */
export function figure(panels, { width, theme, title, description, shared = true }) {
  const ends = [LEFT, width - rightOf(panels, width)];
  const parts = [];
  let top = TOP;
  for (const [number, panel] of panels.entries()) {
    const isLast = number === panels.length - 1;
    parts.push(...panelOf(panel, { ends, top, theme, number, hasLabels: isLast || !shared }));
    top += panel.height + (isLast ? 0 : shared ? GAP : GAP + BOTTOM);
  }
  const height = top + BOTTOM;
  const text = [h("title", { id: "figure-title" }, title), h("desc", { id: "figure-words" }, description)];
  const back = h("rect", { width, height, fill: theme.back });
  const look = { "font-family": FONT, "font-size": 12, fill: theme.ink };
  const size = { viewBox: `0 0 ${width} ${height}`, width, height };
  return h(
    "svg",
    {
      xmlns: "http://www.w3.org/2000/svg",
      ...size,
      role: "img",
      "aria-labelledby": "figure-title figure-words",
      ...look,
    },
    ...text,
    back,
    ...parts,
  );
}

/** Return the places in a figure of the panels' ends: left, right, and top and bottom of each.
 * @param {Panel[]} panels
 * @param {number} width
 * @param {boolean} shared */
export function frames(panels, width, shared = true) {
  let top = TOP;
  const rows = panels.map(({ height }) => {
    const row = [top, top + height];
    top += height + (shared ? GAP : GAP + BOTTOM);
    return row;
  });
  return { left: LEFT, right: width - rightOf(panels, width), rows };
}

/** @param {Panel} panel
 * @param {{ ends: number[], top: number, theme: Theme, number: number, hasLabels: boolean }} about
 * @returns {Node[]} */
function panelOf({ x, y, height, marks }, { ends, top, theme, number, hasLabels }) {
  const [left, right] = ends;
  const bottom = top + height;
  const [across, along] = [placed(x, left, right), placed(y, bottom, top)];
  // an axis without a label is none
  const rows = y.label ? ticks(y, Math.max(2, height / 36)) : { large: [], small: [] };
  const columns = ticks(x, Math.max(2, (right - left) / 90));
  const grid = [
    ...columns.large.map((value) => `M${across(value).toFixed(1)} ${top}V${bottom}`),
    ...rows.large.map((value) => `M${left} ${along(value).toFixed(1)}H${right}`),
  ];
  // ticks point inwards on all four sides, as in the figures of sim plot
  const inward = (
    /** @type {number[]} */ values,
    /** @type {(value: number) => number} */ at,
    /** @type {number} */ size,
  ) =>
    values.map((value) =>
      at === across
        ? `M${at(value).toFixed(1)} ${bottom}v${-size}M${at(value).toFixed(1)} ${top}v${size}`
        : `M${left} ${at(value).toFixed(1)}h${size}M${right} ${at(value).toFixed(1)}h${-size}`,
    );
  const marked = [
    ...inward(columns.large, across, 5),
    ...inward(columns.small, across, 3),
    ...inward(rows.large, along, 5),
    ...inward(rows.small, along, 3),
  ];
  const clip = `panel-${number}`;
  const labels = endings(marks, theme, along);
  const places = spread(labels, top + 6, bottom - 2);
  const middle = (top + bottom) / 2;
  return [
    h("clipPath", { id: clip }, h("rect", { x: left, y: top, width: right - left, height })),
    h("path", { d: grid.join(""), stroke: theme.grid, fill: "none" }),
    h(
      "g",
      { "clip-path": `url(#${clip})`, class: "marks" },
      ...marks.flatMap((mark) => shapes(mark, across, along, [top, bottom])),
    ),
    h("path", { d: marked.join(""), stroke: theme.ink, fill: "none", "stroke-width": 0.8 }),
    h("rect", { x: left, y: top, width: right - left, height, fill: "none", stroke: theme.ink, "stroke-width": 0.8 }),
    ...rows.large.map((value) =>
      h("text", { x: left - 6, y: (along(value) + 4).toFixed(1), "text-anchor": "end" }, ticked(value)),
    ),
    ...(hasLabels
      ? columns.large.map((value) =>
          h("text", { x: across(value).toFixed(1), y: bottom + 16, "text-anchor": "middle" }, ticked(value)),
        )
      : []),
    ...(hasLabels
      ? [h("text", { x: (left + right) / 2, y: bottom + 33, "text-anchor": "middle", class: "xtitle" }, x.label)]
      : []),
    h("text", { transform: `translate(15 ${middle}) rotate(-90)`, "text-anchor": "middle", class: "ytitle" }, y.label),
    ...labels.flatMap(({ text, colour, at }, k) => [
      h("path", {
        d: `M${right} ${at.toFixed(1)}L${right + 8} ${places[k].toFixed(1)}h8`,
        stroke: colour,
        "stroke-width": 2,
        fill: "none",
      }),
      h("text", { x: right + 20, y: (places[k] + 4).toFixed(1) }, text),
    ]),
  ];
}

/** Return the colour of a share from −1 (blue) over 0 (white) to 1 (red).
 * @param {number} share
 * @returns {[number, number, number]} */
export function diverging(share) {
  const [dark, size] = [share < 0 ? [33, 102, 172] : [178, 24, 43], Math.min(1, Math.abs(share))];
  return /** @type {[number, number, number]} */ (dark.map((part) => Math.round(255 + (part - 255) * size)));
}
