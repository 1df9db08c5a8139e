// @ts-check
/**
 * Numbers, times and sizes as people read them. Pure; the same value is written the same way on every page.
 */

/**
 * Three significant digits; small and large ones as 1.08e-2, the form in which errors are compared.
 * @param {number | null | undefined} value
 */
export function number(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "-∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 0.1 || size >= 10 ** (digits + 1)) return value.toExponential(digits - 1);
  return value.toPrecision(digits);
}

/** A share: 0.314 → "31 %". @param {number | null | undefined} share */
export function percent(share, digits = 0) {
  return Number.isFinite(share) ? `${(Number(share) * 100).toFixed(digits)} %` : "–";
}

/** A whole number with thin spaces between thousands. @param {number | null | undefined} value */
export function count(value) {
  return value === null || value === undefined ? "–" : String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** "1 cell", "3 cells". @param {number} value @param {string} one @param {string} [many] */
export function counted(value, one, many = `${one}s`) {
  return `${count(value)}\u00a0${value === 1 ? one : many}`;
}

/**
 * The two units that matter: "850 ms", "12 s", "3 min 20 s", "2 h 5 min", "3 d 4 h".
 * @param {number | null | undefined} seconds
 */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 0.0005) return "0 s";
  if (seconds < 0.9995) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  /** @type {(large: number, one: string, small: number, other: string) => string} */
  const two = (large, one, small, other) => (small ? `${large} ${one} ${small} ${other}` : `${large} ${one}`);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return two(Math.floor(whole / 60), "min", whole % 60, "s");
  const minutes = Math.round(seconds / 60);
  if (minutes < 1440) return two(Math.floor(minutes / 60), "h", minutes % 60, "min");
  const hours = Math.round(seconds / 3600);
  return two(Math.floor(hours / 24), "d", hours % 24, "h");
}

/** In powers of a thousand, as disks are sold: "3.4 MB". @param {number | null | undefined} size */
export function bytes(size) {
  if (size === null || size === undefined) return "–";
  let rest = size;
  for (const unit of ["B", "kB", "MB", "GB"]) {
    if (rest < 999.5) return `${unit === "B" ? rest : Number(rest.toPrecision(3))} ${unit}`;
    rest /= 1000;
  }
  return `${Number(rest.toPrecision(3))} TB`;
}

/**
 * Local time, as short as it is clear: "14:05" today, "3 Mar 14:05" this year. Put the ISO text itself in `title`.
 * @param {string | null | undefined} iso
 */
export function when(iso, now = new Date()) {
  if (!iso) return "–";
  const time = new Date(iso);
  const clock = `${pad(time.getHours())}:${pad(time.getMinutes())}`;
  if (time.toDateString() === now.toDateString()) return clock;
  const date = `${time.getDate()} ${time.toLocaleString("en-GB", { month: "short" })}`;
  return time.getFullYear() === now.getFullYear() ? `${date} ${clock}` : `${date} ${time.getFullYear()}`;
}

/** @param {number} value */
function pad(value) {
  return String(value).padStart(2, "0");
}
