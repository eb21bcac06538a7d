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
  return found.map((/** @type {any} */ { of, x, y, height, marks }) => {
    const own = more.filter((/** @type {any} */ mark) => of && mark.of === of);
    const drawn = [...own, ...marks].map((/** @type {any} */ mark) => ({
      ...mark,
      title: plays?.[mark.name]?.words,
      label: greek(mark.label ?? ""),
      colour: /** @type {any} */ (COLOURS)[mark.colour] ?? theme.ink,
    }));
    const across = drawn.map((/** @type {Mark} */ mark) => mark.x);
    return { x: axisOf(greek(x.label), across, x), y: axisOf(y.label, drawn.flatMap(extent), y), height, marks: drawn };
  });
}

/** Return the curves that are drawn: the last ones of the figure. They are those of the present numbers but for the
 * moment until the server has answered.
 * @param {State} state */
export function curvesOf(state) {
  const found = state.answers.curves;
  if (!found || found.answer.faults) return null;
  const figure = state.view.figure === "sweep" ? "sweep" : "speed";
  return found.of.figure === figure ? found.answer : null;
}

/** @param {State} state
 * @param {Theme} theme
 * @param {boolean} narrow
 * @returns {Panel[]} */
function ofCurves(state, theme, narrow) {
  const shown = curvesOf(state);
  if (!shown) return [];
  const { curves, units, axis, level, data } = shown;
  const [perX, unitX] = axis.unit;
  const x = times(shown.x, perX);
  const sized = state.view.absolute ? "contact_area" : "area_ratio";
  const unitOf = (/** @type {string} */ name) => units[name] ?? [100, "%"];
  /** @type {(name: string, more?: Partial<Mark> & { from?: any }) => Mark} */
  const line = (name, { from = shown, ...more } = {}) => ({
    kind: "line",
    x: from === shown ? x : times(from.x, perX),
    y: times(from.curves[name] ?? [], unitOf(name)[0]),
    colour: theme.ink,
    ...more,
  });
  const { pin } = state;
  const figure = state.answers.curves.of.figure;
  const isPinned = pin?.of.figure === figure;
  const before = isPinned ? pin?.answer : isCurrent(state, "before") ? state.answers.before.answer : null;
  const name = isPinned ? "pinned" : "as it came";
  const dotted = { from: before, colour: COLOURS.rest, dash: "1 4", width: 2, name };
  const hasChanged = before && !same(before.values, shown.values);
  /** @type {(name: string) => Mark[]} */
  const beside = (quantity) => [
    ...(hasChanged ? [line(quantity, { ...dotted, label: quantity === sized ? name : "" })] : []),
    ...(current(state, "others")?.others ?? []).map((/** @type {any} */ other) =>
      line(quantity, {
        from: { x: state.answers.others.answer.x, ...other },
        colour: COLOURS.rest,
        width: 1.2,
        label: greek(other.label),
      }),
    ),
    ...ofRun(state, quantity, unitOf(quantity)[0], axis),
    ...ofData(data, quantity, unitOf(quantity)[0], perX, theme),
  ];
  const areas = stacked(state, shown, theme, line);
  const [, unit] = unitOf(sized);
  const marks = {
    area: [...areas, ...beside(sized), rule(level, perX)],
    energy: [
      line("fluctuation_energy", { colour: COLOURS.fluctuations, label: "ΔΓ" }),
      line("work_of_adhesion", { label: "w" }),
      rule(level, perX),
    ],
    friction: [line("friction_force", { label: "F" }), ...beside("friction_force"), rule(level, perX)],
  };
  const letter = lettered(axis.symbol).join("");
  const across = axisOf(`${axis.name} ${letter} ${unitX ? `(${unitX})` : ""}`, [x], { log: axis.log, tight: true });
  /** @type {(label: string, marks: Mark[], height: number) => Panel} */
  const panel = (label, drawn, height) => ({
    x: across,
    y: axisOf(label, drawn.filter(({ kind }) => kind !== "rule").flatMap(extent), { zero: true }),
    height,
    marks: drawn,
  });
  const size = state.view.absolute ? `area A (${unit})` : "area (% of JKR's)";
  const first = panel(size, marks.area, narrow ? 230 : 300);
  if (narrow) return [first];
  const energy = panel(`energy (${unitOf("work_of_adhesion")[1]})`, marks.energy, 110);
  const friction = panel(`friction (${unitOf("friction_force")[1]})`, marks.friction, 130);
  // a scene without any friction has no panel of it
  return largest(curves.friction_force) ? [first, energy, friction] : [first, energy];
}

/** Return the numbers that an axis has to hold.
 * @param {Mark} mark
 * @returns {Numbers[]} */
function extent({ kind, y, high }) {
  if (kind !== "points" || !high) return high ? [y, high] : [y];
  return [
    plus(
      y,
      high.map((error) => error ?? 0),
    ),
    plus(
      y,
      high.map((error) => -(error ?? 0)),
    ),
  ];
}

/** @param {any} level
 * @param {number} factor
 * @returns {Mark} */
const rule = (level, factor) => ({
  kind: "rule",
  x: times(level.places, factor),
  y: [],
  colour: COLOURS.rest,
  width: 1,
});

/** Return the area that is left, and above it what each mechanism takes.
 * @param {State} state
 * @param {any} shown
 * @param {Theme} theme
 * @param {(name: string, more?: any) => Mark} line
 * @returns {Mark[]} */
function stacked(state, shown, theme, line) {
  const { curves } = shown;
  const sized = state.view.absolute ? "contact_area" : "area_ratio";
  const left = line(sized, { width: 2.5, label: "area", name: "area" });
  const whole = left.y.map((value, k) =>
    value !== null && curves.area_ratio[k] ? value / curves.area_ratio[k] : null,
  );
  const swap = state.view.first && curves.lost_to_bonds_last;
  const bonds = [swap ? "lost_to_bonds_last" : "lost_to_bonds", "lost to bonds", COLOURS.bonds];
  const waves = [
    swap ? "lost_to_fluctuations_first" : "lost_to_fluctuations",
    "lost to fluctuations",
    COLOURS.fluctuations,
  ];
  const order = [
    ["lost_to_mean_stress", "lost to mean stress", COLOURS.stress],
    ...(swap ? [bonds, waves] : [waves, bonds]),
  ];
  /** @type {Mark[]} */
  const result = [];
  let level = left.y;
  for (const [name, label, colour] of order.filter(([key]) => curves[key])) {
    const share = /** @type {Numbers} */ (curves[name]);
    const taken = share.map((value, k) => {
      const full = whole[k];
      return value === null || full === null ? null : value * full;
    });
    const high = plus(level, taken);
    // a mechanism that takes nothing has no label
    const most = Math.max(...share.map((value) => Math.abs(value ?? 0)));
    if (most > 1e-4) result.push({ kind: "band", x: left.x, y: level, high, colour, opacity: 0.35, label, name });
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
  const isStale = state.run && differences(state, state.run.of.values) !== "";
  const band = current(state, "band");
  const runs = [
    ...(state.run && !isStale ? [] : band ? [[band, nameOf(band.members)]] : []),
    ...(state.run ? [[state.run.answer, nameOfRun(state)]] : []),
  ];
  return runs
    .filter(([run]) => run.along === "speed")
    .flatMap(([run, label]) => {
      const { mean, low, high } = run.curves[name];
      const x = times(run.speed, axis.unit[0]);
      const middle = times(mean, factor);
      const isThin = Boolean(isStale) && run === state.run?.answer;
      const look = { x, y: middle, colour: COLOURS.own, label: name === "friction_force" ? "" : label };
      if (x.length < 3) {
        return [
          /** @type {Mark} */ ({
            kind: "points",
            ...look,
            high: plus(times(high, factor), times(mean, -factor)),
            width: isThin ? 1 : 2,
            name: isThin ? "ran" : "own",
          }),
        ];
      }
      const dashed = /** @type {Mark} */ ({
        kind: "line",
        ...look,
        width: isThin ? 0.8 : 2,
        dash: "6 4",
        name: isThin ? "ran" : "own",
      });
      if (isThin) return [dashed];
      return [
        /** @type {Mark} */ ({
          kind: "band",
          x,
          y: times(low, factor),
          high: times(high, factor),
          colour: COLOURS.own,
          opacity: 0.2,
          name: "interval",
        }),
        dashed,
      ];
    });
}

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
  return [
    {
      kind: "points",
      x: times(points.x, perX),
      y: times(points.values, factor),
      high: times(points.errors, factor),
      colour: theme.ink,
      width: 1.5,
      label: "measured",
      name: "measured",
    },
  ];
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
  const changes = /** @type {Mark} */ ({
    kind: "rule",
    x: pieces.slice(1).map(({ from }) => from * perTime),
    y: [],
    colour: COLOURS.own,
    width: 1,
    name: "changed",
  });
  /** @type {(name: string, words: string, unit: string, zero: boolean, colour?: string) => Panel} */
  const over = (name, words, unit, zero, colour = theme.ink) => {
    const [factor, shown] = scaled(largest(columns[name]), unit);
    const y = times(columns[name], factor);
    const line = /** @type {Mark} */ ({ kind: "line", x: t, y, colour, width: 1.4, name });
    const others = besides(state, ["t", perTime], [name, factor]);
    const ends = [y, ...others.map((mark) => mark.y)];
    return { x: time, y: axisOf(`${words} (${shown})`, ends, { zero }), height, marks: [...others, line, changes] };
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
    .map((/** @type {any} */ { label, columns }) => ({
      kind: "line",
      x: times(columns[x], perX),
      y: times(columns[y], perY),
      colour: COLOURS.rest,
      width: 1,
      label: greek(label),
      name: "other",
    }));
}

/** @param {Numbers} values */
const largest = (values) =>
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
  const [perX, unitX] = scaled(largest(columns[known]), known === "normal_load" ? "N" : "m");
  const [perY, unitY] = scaled(largest(columns[along]), along === "normal_load" ? "N" : "m");
  const x = times(columns[known], perX);
  const y = broken(times(columns[along], perY), isLoad);
  const words = (/** @type {string} */ name, /** @type {string} */ unit) => `${name.replaceAll("_", " ")} (${unit})`;
  const loop = /** @type {Mark} */ ({ kind: "line", x, y, colour: theme.ink, width: 1.6, name: "loop" });
  const others = besides(state, [known, perX], [along, perY]).map((mark) => ({ ...mark, y: broken(mark.y, isLoad) }));
  const [wide, high] = [
    [x, ...others.map((mark) => mark.x)],
    [y, ...others.map((mark) => mark.y)],
  ];
  return [
    {
      x: axisOf(words(known, unitX), wide),
      y: axisOf(words(along, unitY), high),
      height: 260,
      marks: [...others, loop],
    },
    over("contact_area", "area A", "m^2", true),
  ];
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
