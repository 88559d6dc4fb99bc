// Histogram of the distances of the moved source points from the target.
import { h, svg } from "./dom";
import { rampColor } from "./colors";
import { short } from "./pose";

const BINS = 40;
const SHOWN_SHARE = 0.98;
const RANGE_IN_THRESHOLDS = 2;
const [WIDTH, HEIGHT] = [320, 110];

/** Make the heading, the picture and its statistics. */
export function makeHistogram(distances: Float32Array, threshold: number, unit: string): (Element | string)[] {
  const sorted = Float32Array.from(distances).sort();
  const at = (share: number): number => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? 0;
  const end = Math.max(at(SHOWN_SHARE), threshold) || 1;
  const counts = new Array<number>(BINS).fill(0);
  for (const distance of sorted) {
    if (distance > end) break;
    const bin = Math.min(BINS - 1, Math.floor((distance / end) * BINS));
    counts[bin] = (counts[bin] ?? 0) + 1;
  }
  const top = Math.max(...counts, 1);
  const width = WIDTH / BINS;
  const bars = counts.map((count, i) => {
    const height = (count / top) * HEIGHT;
    const [red, green, blue] = rampColor(((i + 0.5) / BINS) * (end / (RANGE_IN_THRESHOLDS * threshold || 1)));
    return svg("rect", { x: i * width, y: HEIGHT - height, width: width - 1, height, fill: `rgb(${red},${green},${blue})` });
  });
  const place = (threshold / end) * WIDTH;
  const line = svg("line", { x1: place, x2: place, y1: 0, y2: HEIGHT, class: "threshold" });
  const statistics = `median ${short(at(0.5))}, 95 % within ${short(at(0.95))} ${unit}`;
  const picture = svg(
    "svg",
    { viewBox: `0 -4 ${WIDTH} ${HEIGHT + 24}`, role: "img", "aria-label": `Histogram of distances: ${statistics}`, class: "histogram" },
    ...bars,
    line,
    svg("text", { x: 0, y: HEIGHT + 15 }, "0"),
    svg("text", { x: WIDTH, y: HEIGHT + 15, "text-anchor": "end" }, `${short(end)} ${unit}`),
  );
  return [
    h("h2", {}, "Distances"),
    picture,
    h("p", {}, `Of the moved source from the target: ${statistics}.`),
    h("p", { className: "help" }, `The line marks the inlier threshold, ${short(threshold)} ${unit}. ${Math.round(100 * (1 - SHOWN_SHARE))} % lie beyond at most.`),
  ];
}
