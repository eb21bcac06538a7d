// Numbers with their units, and symbols, as the commands of sim print them.

const PREFIXES = ["f", "p", "n", "µ", "m", "", "k", "M", "G", "T"];
const PREFIXABLE = /^(m|s|N|Pa|J)(?:\^(\d))?($|[/ ].*)/;
const GREEK = new Map(
  Object.entries({
    alpha: "α",
    beta: "β",
    chi: "χ",
    delta: "δ",
    Delta: "Δ",
    gamma: "γ",
    eta: "η",
    kappa: "κ",
    lambda: "λ",
    nu: "ν",
    rho: "ρ",
    sigma: "σ",
    tau: "τ",
  }),
);

/** Return the factor from SI to a unit whose prefix suits a magnitude, and that unit.
 * @param {number} magnitude
 * @param {string} unit
 * @returns {[number, string]} */
export function scaled(magnitude, unit) {
  const shown = unit.replaceAll("^2", "²").replaceAll("^3", "³");
  const match = PREFIXABLE.exec(unit);
  const size = Math.abs(Number(magnitude.toExponential(3)));
  if (!match || !(size > 0)) return [1, unit === "1" ? "" : shown];
  const power = Number(match[2] || 1);
  const thousands = (Math.log10(size) + 2 * (power - 1) + 1e-12) / (3 * power);
  const place = Math.min(Math.max(Math.floor(thousands), -5), 4);
  return [10 ** (-3 * place * power), PREFIXES[place + 5] + shown];
}

/** Return a number with four digits at most.
 * @param {number} value */
export function digits(value) {
  const size = Math.abs(value);
  const isPlain = value === 0 || (size >= 1e-4 && size < 1e7);
  return isPlain ? String(Number(value.toPrecision(4))) : String(Number(value.toPrecision(4)).toExponential());
}

/** Return a number in SI with the unit that suits it, such as "120.3 µm".
 * @param {number} value
 * @param {string} unit */
export function engineering(value, unit) {
  const [factor, shown] = scaled(value, unit);
  return `${digits(value * factor)} ${shown}`.trim();
}

/** Return a symbol, its Greek letters written as such, in a letter and an index.
 * @param {string} symbol
 * @returns {[string, string]} */
export function lettered(symbol) {
  const [letter, index = ""] = symbol.split("_");
  return [GREEK.get(letter) ?? letter, index];
}

/** Return words in which each Greek letter's name is the letter.
 * @param {string} words */
export function greek(words) {
  return words.replace(/[A-Za-z]+/g, (word) => GREEK.get(word) ?? word).replaceAll("_", "");
}
