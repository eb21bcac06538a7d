// The picture of a motion at a time: stage, spring and slider from the side, the contact circle from above.

import { h } from "./figure.js";
import { engineering } from "./notation.js";
import { COLOURS } from "./panels.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./figure.js").Node} Node */
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

/** Return the picture of the motion at its time.
 * @param {State} state
 * @param {Theme} theme
 * @param {number} width
 * @param {{ href: string, side: number, energy: number } | null} map
 * @returns {Node} */
export function picture(state, theme, width, map) {
  const { motion } = state;
  const parts = [h("title", {}, "The motion"), h("desc", {}, reading(state))];
  const size = HEIGHT - 40;
  const isDriven = motion.columns.slider_position !== undefined;
  if (isDriven && width > 420) parts.push(...side(motion, theme, size + 40, width));
  parts.push(...above(motion, theme, size, map));
  return h(
    "svg",
    {
      viewBox: `0 0 ${width} ${HEIGHT}`,
      width,
      height: HEIGHT,
      role: "img",
      "aria-label": "The motion",
      "font-family": "system-ui, sans-serif",
      "font-size": 12,
      fill: theme.ink,
    },
    ...parts,
  );
}

/** Return the largest size of a column.
 * @param {(number | null)[]} values */
const largest = (values) =>
  values.reduce((/** @type {number} */ most, value) => Math.max(most, Math.abs(value ?? 0)), 0);

/** Return stage, spring and slider. Extension of the spring and marks on the ground have one scale.
 * @param {import("./state.js").Motion} motion
 * @param {Theme} theme
 * @param {number} left
 * @param {number} width
 * @returns {Node[]} */
function side(motion, theme, left, width) {
  const [from, to] = [left + 20, width - 10];
  const ground = 150;
  const position = at(motion, "slider_position") ?? 0;
  const stage = at(motion, "stage_position");
  const rest = 90; // of the spring without force, in pixels
  const { stage_position: stages, slider_position: sliders } = motion.columns;
  const extension = stages ? largest(stages.map((value, k) => (value ?? 0) - (sliders[k] ?? 0))) : largest(sliders) / 4;
  const scale = (0.25 * (to - from)) / (extension || 1);
  const camera = stage ?? position;
  const hold = stage === null ? (from + to) / 2 : to - 60;
  const slider = stage === null ? hold : hold - rest - scale * (stage - position);
  const spacing =
    10 ** Math.floor(Math.log10(60 / scale)) * (60 / scale / 10 ** Math.floor(Math.log10(60 / scale)) > 5 ? 5 : 2);
  const first = Math.floor((camera - (hold - from) / scale) / spacing);
  const marks = Array.from(
    { length: Math.ceil((to - from) / (spacing * scale)) + 2 },
    (_, k) => hold + scale * ((first + k) * spacing - camera),
  );
  const hatched = marks.filter((x) => x > from && x < to).map((x) => `M${x.toFixed(1)} ${ground}l-8 10`);
  const turns = 9;
  const [start, end] = [slider + 26, hold];
  const coil = Array.from(
    { length: 2 * turns - 1 },
    (_, k) => `L${(start + ((k + 1) * (end - start)) / (2 * turns)).toFixed(1)} ${k % 2 ? 118 : 102}`,
  );
  const bar = spacing * scale;
  return [
    h("path", { d: `M${from} ${ground}H${to}${hatched.join("")}`, stroke: theme.ink, fill: "none" }),
    h("path", {
      d: `M${slider - 26} ${ground - 62}h52v44a26 18 0 0 1 -52 0Z`,
      fill: theme.grid,
      stroke: theme.ink,
      "data-x": slider.toFixed(2),
    }),
    h("text", { x: slider, y: 106, "text-anchor": "middle" }, "slider"),
    ...(stage === null
      ? [
          h("path", {
            d: `M${slider + 28} 110h50m-8 -5l8 5l-8 5`,
            stroke: COLOURS.fluctuations,
            "stroke-width": 2,
            fill: "none",
          }),
          h("text", { x: slider + 84, y: 114 }, "force"),
        ]
      : [
          h("path", {
            d: `M${start} 110${coil.join("")}L${end} 110`,
            stroke: COLOURS.bonds,
            "stroke-width": 2,
            fill: "none",
            "stroke-linejoin": "round",
          }),
          h("rect", { x: hold, y: 84, width: 50, height: 52, fill: theme.grid, stroke: theme.ink }),
          h("text", { x: hold + 25, y: 114, "text-anchor": "middle" }, "stage"),
        ]),
    h("path", {
      d: `M${from} ${ground + 22}h${bar.toFixed(1)}m0 -4v8M${from} ${ground + 18}v8`,
      stroke: theme.ink,
      fill: "none",
    }),
    h("text", { x: from + bar + 8, y: ground + 26 }, engineering(spacing, "m")),
  ];
}

/** Return the contact circle, under which the stress passes. The strength of its colours follows the fluctuations.
 * @param {import("./state.js").Motion} motion
 * @param {Theme} theme
 * @param {number} size
 * @param {{ href: string, side: number, energy: number } | null} map
 * @returns {Node[]} */
function above(motion, theme, size, map) {
  const radius = at(motion, "contact_radius") ?? 0;
  const most = largest(motion.columns.contact_radius ?? []);
  const wide = Math.max(map?.side ?? 0, 2.6 * most) || 1;
  const scale = size / wide;
  const [x, y] = [10 + size / 2, 5 + size / 2];
  const parts = [h("clipPath", { id: "above" }, h("rect", { x: 10, y: 5, width: size, height: size }))];
  if (map) {
    const side = map.side * scale;
    const passed = (((at(motion, "slider_position") ?? 0) * scale) % side) - side;
    const energy = at(motion, "fluctuation_energy") ?? 0;
    const opacity = Math.min(1, Math.sqrt(Math.max(0, energy) / map.energy));
    const look = { y: y - side / 2, width: side + 0.5, height: side, href: map.href, preserveAspectRatio: "none" };
    const images = [0, 1, 2].map((k) => h("image", { ...look, x: (10 - passed + (k - 2) * side).toFixed(2) }));
    parts.push(h("rect", { x: 10, y: 5, width: size, height: size, fill: "#ffffff" }));
    parts.push(h("g", { "clip-path": "url(#above)", opacity: opacity.toFixed(3) }, ...images));
  }
  parts.push(h("rect", { x: 10, y: 5, width: size, height: size, fill: "none", stroke: theme.soft }));
  parts.push(
    h("circle", {
      cx: x,
      cy: y,
      r: (radius * scale).toFixed(2),
      fill: "none",
      stroke: map ? "#1a1a1a" : theme.ink,
      "stroke-width": 2,
    }),
  );
  parts.push(
    h(
      "text",
      { x, y: size + 22, "text-anchor": "middle" },
      radius ? `contact radius ${engineering(radius, "m")}` : "no contact",
    ),
  );
  return parts;
}
