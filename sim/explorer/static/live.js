// The picture of a motion at a time: stage, spring and slider from the side, the contact circle from above.

import { label, path } from "./figure.js";
import { h } from "./node.js";
import { engineering } from "./notation.js";
import { COLOURS, largest } from "./panels.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./node.js").Node} Node */
/** @typedef {import("./figure.js").Theme} Theme */

const HEIGHT = 190;

/** Return the number of a column at a time, between its neighbours.
 * @param {import("./state.js").Motion} motion
 * @param {string} name
 * @returns {number | null} */
export function at({ columns, time }, name) {
  const [t, values] = [/** @type {number[]} */ (columns.t), columns[name]];
  if (!values?.length) return null;
  let [low, high] = [0, t.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  const [before, after] = [values[low], values[high]];
  if (before === null || after === null || high === low) return before;
  const share = Math.min(1, Math.max(0, (time - t[low]) / (t[high] - t[low])));
  return before + share * (after - before);
}

/** Return the ratio of a motion to real time in words, such as "1 : 10".
 * @param {number} rate */
export function ratio(rate) {
  if (!(rate > 0)) return "at rest";
  const size = rate < 1 ? 1 / rate : rate;
  const number = Number(size.toPrecision(2));
  return rate < 1 ? `1 : ${number}` : `${number} : 1`;
}

/** Return what stands beside the picture: time, speed of the stage, force, area and speed of the slider.
 * @param {State} state */
export function reading({ motion }) {
  const words = [`t = ${engineering(motion.time, "s")}`];
  for (const [name, symbol, unit] of [
    ["stage_speed", "stage at", "m/s"],
    ["spring_force", "spring force", "N"],
    ["normal_load", "load", "N"],
    ["contact_area", "area", "m^2"],
    ["speed", "slider at", "m/s"],
  ]) {
    const value = at(motion, name);
    if (value !== null && motion.columns.t.length) words.push(`${symbol} ${engineering(value, unit)}`);
  }
  return words.join(" · ");
}

/** A map of the fluctuating stress: its picture, its side, and its energy.
 * @typedef {{ href: string, side: number, energy: number }} Waves */

/** Return the picture of the motion at its time.
 * @param {State} state
 * @param {Theme} theme
 * @param {number} width
 * @param {Waves | null} map
 * @returns {Node} */
export function picture(state, theme, width, map) {
  const { motion } = state;
  const size = HEIGHT - 40;
  const isDriven = motion.columns.slider_position !== undefined;
  const box = { viewBox: `0 0 ${width} ${HEIGHT}`, width, height: HEIGHT };
  const look = { "font-family": "system-ui, sans-serif", "font-size": 12, fill: theme.ink };
  return h(
    "svg",
    { ...box, role: "img", "aria-label": "The motion", ...look },
    h("title", {}, "The motion"),
    h("desc", {}, reading(state)),
    h("g", {}, ...(isDriven && width > 420 ? side(motion, theme, size + 40, width) : [])),
    h("g", {}, ...above(motion, theme, size, map)),
  );
}

/** Return stage, spring and slider. Extension of the spring and marks on the ground have one scale.
 * @param {import("./state.js").Motion} motion
 * @param {Theme} theme
 * @param {number} left
 * @param {number} width
 * @returns {Node[]} */
function side(motion, theme, left, width) {
  const [from, to, ground] = [left + 20, width - 10, 150];
  const position = at(motion, "slider_position") ?? 0;
  const stage = at(motion, "stage_position");
  const rest = 90; // of the spring without force, in pixels
  const { stage_position: stages, slider_position: sliders } = motion.columns;
  const extension = stages ? largest(stages.map((value, k) => (value ?? 0) - (sliders[k] ?? 0))) : largest(sliders) / 4;
  const scale = (0.25 * (to - from)) / (extension || 1);
  const camera = stage ?? position;
  const hold = stage === null ? (from + to) / 2 : to - 60;
  const slider = stage === null ? hold : hold - rest - scale * (stage - position);
  const decade = 10 ** Math.floor(Math.log10(60 / scale));
  const spacing = decade * (60 / scale / decade > 5 ? 5 : 2);
  const bar = spacing * scale;
  const first = Math.floor((camera - (hold - from) / scale) / spacing);
  const marks = Array.from(
    { length: Math.ceil((to - from) / bar) + 2 },
    (_, k) => hold + scale * ((first + k) * spacing - camera),
  );
  const hatched = marks.filter((x) => x > from && x < to).map((x) => `M${x.toFixed(1)} ${ground}l-8 10`);
  const [turns, start, middle] = [9, slider + 26, { "text-anchor": "middle" }];
  const coil = Array.from(
    { length: 2 * turns - 1 },
    (_, k) => `L${(start + ((k + 1) * (hold - start)) / (2 * turns)).toFixed(1)} ${k % 2 ? 118 : 102}`,
  );
  const ink = { stroke: theme.ink };
  const force = { stroke: COLOURS.fluctuations, "stroke-width": 2 };
  const spring = { stroke: COLOURS.bonds, "stroke-width": 2, "stroke-linejoin": "round" };
  const pulled =
    stage === null
      ? [path(`M${slider + 28} 110h50m-8 -5l8 5l-8 5`, force), label("force", slider + 84, 114)]
      : [
          path(`M${start} 110${coil.join("")}L${hold} 110`, spring),
          h("rect", { x: hold, y: 84, width: 50, height: 52, fill: theme.grid, ...ink }),
          label("stage", hold + 25, 114, middle),
        ];
  const body = `M${slider - 26} ${ground - 62}h52v44a26 18 0 0 1 -52 0Z`;
  return [
    path(`M${from} ${ground}H${to}${hatched.join("")}`, ink),
    path(body, { fill: theme.grid, ...ink, "data-x": slider.toFixed(2) }),
    label("slider", slider, 106, middle),
    ...pulled,
    path(`M${from} ${ground + 22}h${bar.toFixed(1)}m0 -4v8M${from} ${ground + 18}v8`, ink),
    label(engineering(spacing, "m"), from + bar + 8, ground + 26),
  ];
}

/** Return the contact circle, under which the stress passes. The strength of its colours follows the fluctuations.
 * @param {import("./state.js").Motion} motion
 * @param {Theme} theme
 * @param {number} size
 * @param {Waves | null} map
 * @returns {Node[]} */
function above(motion, theme, size, map) {
  const radius = at(motion, "contact_radius") ?? 0;
  const most = largest(motion.columns.contact_radius ?? []);
  const scale = size / (Math.max(map?.side ?? 0, 2.6 * most) || 1);
  const [x, y] = [10 + size / 2, 5 + size / 2];
  const frame = { x: 10, y: 5, width: size, height: size };
  const circle = { cx: x, cy: y, r: (radius * scale).toFixed(2), stroke: map ? COLOURS.black : theme.ink };
  const words = radius ? `contact radius ${engineering(radius, "m")}` : "no contact";
  return [
    h("clipPath", { id: "above" }, h("rect", frame)),
    ...(map ? [h("rect", { ...frame, fill: "#ffffff" }), passing(motion, map, scale, y)] : []),
    h("rect", { ...frame, fill: "none", stroke: theme.soft }),
    h("circle", { ...circle, fill: "none", "stroke-width": 2 }),
    label(words, x, size + 22, { "text-anchor": "middle" }),
  ];
}

/** Return the map of the stress, side by side, where the slider has come to.
 * @param {import("./state.js").Motion} motion
 * @param {Waves} map
 * @param {number} scale
 * @param {number} middle */
function passing(motion, map, scale, middle) {
  const side = map.side * scale;
  const passed = (((at(motion, "slider_position") ?? 0) * scale) % side) - side;
  const opacity = Math.min(1, Math.sqrt(Math.max(0, at(motion, "fluctuation_energy") ?? 0) / map.energy));
  const look = { y: middle - side / 2, width: side + 0.5, height: side, href: map.href, preserveAspectRatio: "none" };
  const images = [0, 1, 2].map((k) => h("image", { ...look, x: (10 - passed + (k - 2) * side).toFixed(2) }));
  return h("g", { "clip-path": "url(#above)", opacity: opacity.toFixed(3) }, ...images);
}
