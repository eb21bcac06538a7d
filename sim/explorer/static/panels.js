// The panels of the figures: which curves of the state are drawn, and as what.

import { current, differences, isCurrent, isDescribed, nameOf, nameOfRun } from "./answer.js";
import { axisOf } from "./figure.js";
import { greek, lettered, scaled } from "./notation.js";
import { isFitted, same } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./figure.js").Panel} Panel */
/** @typedef {import("./figure.js").Mark} Mark */
/** @typedef {import("./figure.js").Numbers} Numbers */
/** @typedef {import("./figure.js").Theme} Theme */

export const COLOURS = {
  bonds: "#0072B2",
  fluctuations: "#D55E00",
  stress: "#8b6bb1",
  rest: "#8a8a8a",
  own: "#009E73",
  black: "#1a1a1a",
};

/** @param {Numbers} values
 * @param {number} factor
 * @returns {Numbers} */
const times = (values, factor) => values.map((value) => (value === null ? null : value * factor));

/** @param {Numbers} one
 * @param {Numbers} other
 * @returns {Numbers} */
const plus = (one, other) =>
  one.map((value, k) => {
    const more = other[k];
    return value === null || more === null ? null : value + more;
  });

/** Return the panels of the figure that the state shows; none as long as there is no answer.
 * @param {State} state
 * @param {Theme} theme
 * @param {boolean} narrow
 * @returns {Panel[]} */
export function panels(state, theme, narrow) {
  if (isDescribed(state)) return ofServer(state, theme);
  return state.view.figure === "motion" ? ofMotion(state, theme, narrow) : ofCurves(state, theme, narrow);
}

/** Return the answer to which the figure that the server describes belongs: the last one of this figure.
 * @param {State} state */
export function describedOf(state) {
  const found = state.answers.shown;
  return found?.of.figure === state.view.figure && !found.answer.faults ? found : null;
}

/** @param {State} state
 * @param {Theme} theme
 * @returns {Panel[]} */
function ofServer(state, theme) {
  const { panels: found = [], plays } = describedOf(state)?.answer ?? {};
  const more = isFitted(state) ? (state.fit?.answer.marks ?? []) : [];
  const each = found.map((/** @type {any} */ panel) => {
    const own = more.filter((/** @type {any} */ { of }) => of && of === panel.of);
    const marks = [...own, ...panel.marks];
    return { ...panel, marks: marks.map((mark) => ({ ...mark, title: plays?.[mark.name]?.words })) };
  });
  return described(each, theme);
}

/** Return an axis that the server describes. It may know the ends.
 * @param {any} about
 * @param {Numbers[]} each */
function axis({ label, low, high, ...choices }, each) {
  const result = axisOf(greek(label), each, choices);
  return low === undefined ? result : { ...result, low, high };
}

/** Return panels that the server describes.
 * @param {any[]} each
 * @param {Theme} theme
 * @returns {Panel[]} */
export function described(each, theme) {
  return each.map(({ x, y, height, marks }) => {
    const drawn = marks.map((/** @type {any} */ mark) => ({
      ...mark,
      label: greek(mark.label ?? ""),
      colour: /** @type {any} */ (COLOURS)[mark.colour] ?? theme.ink,
    }));
    const across = drawn.map((/** @type {Mark} */ mark) => mark.x);
    return { x: axis(x, across), y: axis(y, drawn.flatMap(extent)), height, marks: drawn };
  });
}

/** Return the curves that are drawn: the last ones of the figure. They are those of the present numbers but for the
 * moment until the server has answered.
 * @param {State} state */
export function curvesOf(state) {
  const found = state.answers.curves;
  const figure = state.view.figure === "sweep" ? "sweep" : "speed";
  return found && !found.answer.faults && found.of.figure === figure ? found.answer : null;
}

/** @param {State} state
 * @param {Theme} theme
 * @param {boolean} narrow
 * @returns {Panel[]} */
function ofCurves(state, theme, narrow) {
  const shown = curvesOf(state);
  if (!shown) return [];
  const { pin, answers, view } = state;
  const { curves, units, axis, level, data } = shown;
  const [perX, unitX] = axis.unit;
  const x = times(shown.x, perX);
  const sized = view.absolute ? "contact_area" : "area_ratio";
  const unitOf = (/** @type {string} */ name) => units[name] ?? [100, "%"];
  /** @type {(name: string, more?: Partial<Mark> & { from?: any }) => Mark} */
  const line = (name, { from = shown, ...more } = {}) => ({
    kind: "line",
    x: from === shown ? x : times(from.x, perX),
    y: times(from.curves[name] ?? [], unitOf(name)[0]),
    colour: theme.ink,
    ...more,
  });
  const isPinned = pin?.of.figure === answers.curves.of.figure;
  const before = isPinned ? pin?.answer : isCurrent(state, "before") ? answers.before.answer : null;
  const name = isPinned ? "pinned" : "as it came";
  const dotted = { from: before, colour: COLOURS.rest, dash: "1 4", name };
  const hasChanged = before && !same(before.values, shown.values);
  const others = current(state, "others")?.others ?? [];
  /** @type {(name: string) => Mark[]} */
  const beside = (quantity) => [
    ...(hasChanged ? [line(quantity, { ...dotted, label: quantity === sized ? name : "" })] : []),
    ...others.map((/** @type {any} */ other) => {
      const from = { x: answers.others.answer.x, ...other };
      return line(quantity, { from, colour: COLOURS.rest, width: 1.2, label: greek(other.label) });
    }),
    ...ofRun(state, quantity, unitOf(quantity)[0], axis),
    ...ofData(data, quantity, unitOf(quantity)[0], perX, theme),
  ];
  const across = axisOf(`${axis.name} ${lettered(axis.symbol).join("")} ${unitX ? `(${unitX})` : ""}`, [x], {
    log: axis.log,
    tight: true,
  });
  /** @type {(label: string, marks: Mark[], height: number) => Panel} */
  const panel = (label, marks, height) => ({
    x: across,
    y: axisOf(label, marks.flatMap(extent), { zero: true }),
    height,
    marks: [...marks, rule(times(level.places, perX))],
  });
  const size = view.absolute ? `area A (${unitOf(sized)[1]})` : "area (% of JKR's)";
  const area = panel(size, [...stacked(state, shown, line), ...beside(sized)], narrow ? 230 : 300);
  if (narrow) return [area];
  const energies = [
    line("fluctuation_energy", { colour: COLOURS.fluctuations, label: "ΔΓ" }),
    line("work_of_adhesion", { label: "w" }),
  ];
  const energy = panel(`energy (${unitOf("work_of_adhesion")[1]})`, energies, 110);
  const forces = [line("friction_force", { label: "F" }), ...beside("friction_force")];
  const friction = panel(`friction (${unitOf("friction_force")[1]})`, forces, 130);
  // a scene without any friction has no panel of it
  return largest(curves.friction_force) ? [area, energy, friction] : [area, energy];
}

/** Return the numbers that an axis has to hold.
 * @param {Mark} mark
 * @returns {Numbers[]} */
function extent({ kind, y, high }) {
  if (!high) return [y];
  if (kind !== "points") return [y, high];
  const errors = high.map((error) => error ?? 0);
  return [plus(y, errors), plus(y, times(errors, -1))];
}

/** Return a thin line across a panel at each of some places.
 * @param {Numbers} x
 * @param {Partial<Mark>} more
 * @returns {Mark} */
const rule = (x, more = {}) => ({ kind: "rule", x, y: [], colour: COLOURS.rest, width: 1, ...more });

/** Return the area that is left, and above it what each mechanism takes.
 * @param {State} state
 * @param {any} shown
 * @param {(name: string, more?: any) => Mark} line
 * @returns {Mark[]} */
function stacked(state, { curves }, line) {
  const left = line(state.view.absolute ? "contact_area" : "area_ratio", { width: 2.5, label: "area", name: "area" });
  const whole = left.y.map((value, k) => (curves.area_ratio[k] ? (value ?? 0) / curves.area_ratio[k] : null));
  const swap = state.view.first && curves.lost_to_bonds_last;
  const bonds = [swap ? "lost_to_bonds_last" : "lost_to_bonds", "lost to bonds", COLOURS.bonds];
  const waves = [
    swap ? "lost_to_fluctuations_first" : "lost_to_fluctuations",
    "lost to fluctuations",
    COLOURS.fluctuations,
  ];
  const stress = ["lost_to_mean_stress", "lost to mean stress", COLOURS.stress];
  /** @type {Mark[]} */
  const result = [];
  let level = left.y;
  for (const [name, label, colour] of swap ? [stress, bonds, waves] : [stress, waves, bonds]) {
    const share = /** @type {Numbers | undefined} */ (curves[name]);
    if (!share) continue;
    const taken = share.map((value, k) => (value === null || whole[k] === null ? null : value * whole[k]));
    const high = plus(level, taken);
    // a mechanism that takes nothing has no label
    if (largest(share) > 1e-4)
      result.push({ kind: "band", x: left.x, y: level, high, colour, opacity: 0.35, label, name });
    level = high;
  }
  return [...result, left];
}

/** Return the marks of an ensemble: of the present numbers with its interval, of earlier ones as a thin line.
 * @param {State} state
 * @param {string} name
 * @param {number} factor
 * @param {any} axis
 * @returns {Mark[]} */
function ofRun(state, name, factor, axis) {
  if (state.view.figure !== "speed") return [];
  const { run } = state;
  const isStale = run !== null && differences(state, run.of.values) !== "";
  const band = current(state, "band");
  const runs = [
    ...(band && (!run || isStale) ? [{ found: band, label: nameOf(band.members), isThin: false }] : []),
    ...(run ? [{ found: run.answer, label: nameOfRun(state), isThin: isStale }] : []),
  ];
  return runs
    .filter(({ found }) => found.along === "speed")
    .flatMap(({ found, label, isThin }) => {
      const { mean, low, high } = found.curves[name];
      const [x, y, end] = [times(found.speed, axis.unit[0]), times(mean, factor), times(high, factor)];
      const own = { x, y, colour: COLOURS.own, name: isThin ? "ran" : "own" };
      const named = { ...own, label: name === "friction_force" ? "" : label };
      if (x.length < 3) {
        return [mark("points", { ...named, high: plus(end, times(y, -1)), width: isThin ? 1 : 2 })];
      }
      const line = mark("line", { ...named, width: isThin ? 0.8 : 2, dash: "6 4" });
      const interval = mark("band", { ...own, y: times(low, factor), high: end, opacity: 0.2, name: "interval" });
      return isThin ? [line] : [interval, line];
    });
}

/** @param {Mark["kind"]} kind
 * @param {Omit<Mark, "kind">} more
 * @returns {Mark} */
const mark = (kind, more) => ({ kind, ...more });

/** Return the marks of measured points.
 * @param {any} data
 * @param {string} name
 * @param {number} factor
 * @param {number} perX
 * @param {Theme} theme
 * @returns {Mark[]} */
function ofData(data, name, factor, perX, theme) {
  const points = data?.points[name];
  if (!points) return [];
  const [y, high] = [times(points.values, factor), times(points.errors, factor)];
  const look = { colour: theme.ink, width: 1.5, label: "measured", name: "measured" };
  return [mark("points", { x: times(points.x, perX), y, high, ...look })];
}

/** Return what is drawn of a motion: two courses over time, or of a moving mount the load over its path and the area.
 * @param {State} state
 * @param {Theme} theme
 * @param {boolean} narrow
 * @returns {Panel[]} */
function ofMotion(state, theme, narrow) {
  const { columns, pieces } = state.motion;
  if (columns.t.length < 2) return [];
  const height = narrow ? 130 : 170;
  const end = state.start.duration;
  const [perTime, unitTime] = scaled(end, "s");
  const t = times(columns.t, perTime);
  const time = axisOf(`time (${unitTime})`, [[0, end * perTime]], { tight: true });
  const changed = { colour: COLOURS.own, name: "changed" };
  const changes = rule(
    pieces.slice(1).map(({ from }) => from * perTime),
    changed,
  );
  /** @type {(name: string, words: string, unit: string, zero: boolean, colour?: string) => Panel} */
  const over = (name, words, unit, zero, colour = theme.ink) => {
    const [factor, shown] = scaled(largest(columns[name]), unit);
    const line = mark("line", { x: t, y: times(columns[name], factor), colour, width: 1.4, name });
    const marks = [...besides(state, ["t", perTime], [name, factor]), line];
    const y = axisOf(
      `${words} (${shown})`,
      marks.map((one) => one.y),
      { zero },
    );
    return { x: time, y, height, marks: [...marks, changes] };
  };
  if (columns.normal_load) return ofMount(state, theme, over);
  const area = over("contact_area", "area A", "m^2", false, COLOURS.bonds);
  if (columns.spring_force) return [over("spring_force", "spring force", "N", true), area];
  const friction = over("friction_force", "friction F", "N", true);
  if (columns.slider_position) return [over("slider_position", "displacement", "m", true), friction, area];
  return [friction, area];
}

/** Return the motions at other points of the sweep as thin lines.
 * @param {State} state
 * @param {[string, number]} across name and factor of a column
 * @param {[string, number]} along
 * @returns {Mark[]} */
function besides(state, [x, perX], [y, perY]) {
  return (current(state, "others")?.others ?? [])
    .filter((/** @type {any} */ { columns }) => columns?.[x] && columns[y])
    .map((/** @type {any} */ { label, columns }) =>
      mark("line", {
        x: times(columns[x], perX),
        y: times(columns[y], perY),
        colour: COLOURS.rest,
        width: 1,
        label: greek(label),
        name: "other",
      }),
    );
}

/** Return the largest size of numbers.
 * @param {Numbers} values */
export const largest = (values) =>
  values.reduce((/** @type {number} */ most, value) => Math.max(most, Math.abs(value ?? 0)), 0);

/** @param {State} state
 * @param {Theme} theme
 * @param {(name: string, words: string, unit: string, zero: boolean) => Panel} over
 * @returns {Panel[]} */
function ofMount(state, theme, over) {
  const { columns } = state.motion;
  const isLoad = state.start.mount === "load";
  const [across, along] = isLoad ? ["normal_load", "contact_radius"] : [state.start.mount, "normal_load"];
  const known = columns[across] ? across : "displacement";
  /** @type {(name: string) => [number, string]} */
  const scale = (name) => {
    const [factor, unit] = scaled(largest(columns[name]), name === "normal_load" ? "N" : "m");
    return [factor, `${name.replaceAll("_", " ")} (${unit})`];
  };
  const [[perX, wordsX], [perY, wordsY]] = [scale(known), scale(along)];
  const look = { colour: theme.ink, width: 1.6, name: "loop" };
  const loop = mark("line", { x: times(columns[known], perX), y: times(columns[along], perY), ...look });
  const marks = [...besides(state, [known, perX], [along, perY]), loop].map((one) => ({
    ...one,
    y: broken(one.y, isLoad),
  }));
  const [x, y] = [
    axisOf(
      wordsX,
      marks.map((one) => one.x),
    ),
    axisOf(
      wordsY,
      marks.map((one) => one.y),
    ),
  ];
  return [{ x, y, height: 260, marks }, over("contact_area", "area A", "m^2", true)];
}

/** Return radii without those at which a contact under a load has jumped open or closed, so that no line joins them.
 * @param {Numbers} radii
 * @param {boolean} isLoad */
const broken = (radii, isLoad) => radii.map((radius, k) => (isLoad && k && !radius !== !radii[k - 1] ? null : radius));

/** Return the panels as a table: its headings, and a row for each place of the first axis.
 * @param {Panel[]} shown
 * @returns {{ head: string[], rows: (number | null)[][] }} */
export function tableOf(shown) {
  const lines = shown.flatMap(({ marks, y }) =>
    marks.filter(({ kind }) => kind === "line" || kind === "band").map((mark) => ({ mark, y })),
  );
  const { x } = shown[0].marks.find(({ kind, name }) => kind === "line" && name !== "other") ?? { x: [] };
  const same = lines.filter(({ mark }) => mark.x.length === x.length);
  const every = Math.ceil(x.length / 200);
  const rows = x.map((at, k) => [
    at,
    ...same.map(({ mark }) => {
      const [low, high] = [mark.y[k], mark.high?.[k]];
      return mark.kind === "band" && low !== null && high !== null && high !== undefined ? high - low : low;
    }),
  ]);
  const head = [
    shown[0].x.label,
    ...same.map(({ mark, y }) => {
      const name = mark.label || mark.name?.replaceAll("_", " ");
      return name ? `${name}${/ \(.*\)$/.exec(y.label) ?? ""}` : y.label;
    }),
  ];
  return { head, rows: rows.filter((_, k) => k % every === 0) };
}
