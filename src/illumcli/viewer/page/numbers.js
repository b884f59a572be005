// Numbers as people read them, and the places of numbers on sliders.

export const STEPS = 200; // of a slider
const DECADES = 4; // of a logarithmic slider that begins at 0

export function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

/** A number with as many digits as a reader needs: 0.0422, 12.5, 1,234,567. */
export function shown(number, digits = 4) {
  if (number === null || number === undefined) return "–";
  if (!Number.isFinite(number)) return String(number);
  const size = Math.abs(number);
  if (size >= 10 ** digits) return Math.round(number).toLocaleString("en");
  return size !== 0 && size < 1e-4 ? number.toExponential(digits - 2) : String(Number(number.toPrecision(digits)));
}

/** A large count in short: 230k, 1.2M. */
export function counted(number) {
  const [size, sign] = number >= 1e9 ? [1e9, "G"] : number >= 1e6 ? [1e6, "M"] : number >= 1e3 ? [1e3, "k"] : [1, ""];
  return `${Number((number / size).toPrecision(3))}${sign}`;
}

/** Without digits that a slider or a colour well cannot mean. */
export function rounded(number, digits = 4) {
  return Number(number.toPrecision(digits));
}

/** The next number of the form 1, 2 or 5 times a power of 10, at or above a positive one. */
export function roundUp(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  return [1, 2, 5, 10].find((step) => step * power >= number * (1 - 1e-9)) * power;
}

/**
 * The range of a control's slider. Where the description sets no limit, it ends at some times the larger of the
 * value and the default, and grows when the value leaves it.
 */
export class SliderScale {
  constructor({ minimum = null, maximum = null, logarithmic = false, default: standard = null, value = null }) {
    const usual = Math.max(...[standard, value].flat().map((each) => Math.abs(Number(each) || 0)));
    this.high = maximum ?? roundUp(4 * (usual || 0.25));
    this.low = minimum ?? -this.high;
    this.bounded = maximum !== null;
    this.logarithmic = logarithmic && this.low >= 0 && this.high > 0;
    this.start = this.low > 0 ? this.low : this.high / 10 ** DECADES;
  }

  /** The value at a place from 0 to STEPS. */
  value(place) {
    const share = place / STEPS;
    if (!this.logarithmic) {
      const step = (this.high - this.low) / STEPS;
      const digits = clamp(1 - Math.floor(Math.log10(step)), 0, 12);
      return Number((this.low + share * (this.high - this.low)).toFixed(digits));
    }
    return share === 0 ? this.low : rounded(this.start * (this.high / this.start) ** share, 3);
  }

  /** The place of a value, which widens the range if it lies beyond. */
  place(value) {
    if (!this.bounded && value > this.high) this.high = roundUp(2 * value);
    if (value < this.low && this.low < 0) this.low = -roundUp(-2 * value);
    const share = !this.logarithmic
      ? (value - this.low) / (this.high - this.low)
      : value <= this.start ? 0 : Math.log(value / this.start) / Math.log(this.high / this.start);
    return Math.round(STEPS * clamp(share, 0, 1));
  }
}
