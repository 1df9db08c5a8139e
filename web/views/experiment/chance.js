// @ts-check
/**
 * How unlikely a deviation is by chance, when its standard error was itself estimated from a few replicates.
 *
 * With four replicates a mean lies more than 3 standard errors off in 6 of 100 cases, not in 3 of 1000; a grid of many
 * cells would be full of false alarms. Pure.
 *
 * Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4; Fisher, Statistical Methods for Research
 * Workers, 21.1.
 */

/**
 * Probability that Student's t with `degrees` of freedom is farther from 0 than `t`, on either side.
 * Exact up to rounding: below about 1e-15 it comes out as 0.
 * @param {number} t @param {number} degrees whole, 1 or more
 */
export function tail(t, degrees) {
  const angle = Math.atan(Math.abs(t) / Math.sqrt(degrees));
  const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
  const odd = degrees % 2 === 1;
  let term = odd ? cos : 1;
  let sum = degrees === 1 ? 0 : term;
  for (let k = odd ? 3 : 2; k < degrees; k += 2) {
    term *= ((k - 1) / k) * cos * cos;
    sum += term;
  }
  const inside = odd ? (2 / Math.PI) * (angle + sin * sum) : sin * sum;
  return Math.max(0, 1 - inside);
}

/**
 * Probability that `count` independent tests together look as bad as they do by chance, from the sum of the natural
 * logarithms of their probabilities (Fisher's method; chi² with 2 · count degrees of freedom has a closed form).
 * @param {number} logs @param {number} count
 */
export function combined(logs, count) {
  let term = 1;
  let sum = 1;
  for (let k = 1; k < count; k++) {
    term *= -logs / k;
    sum += term;
  }
  return Math.min(1, Math.exp(logs) * sum);
}
