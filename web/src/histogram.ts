// Histogram of the distances of the moved source points from the target.
import { h, svg } from "./dom";
import { areSigned, chooseRange, distanceColor } from "./colors";
import { short } from "./pose";
import { percent } from "./verdict";

const BINS = 40;
/** The picture goes so much farther than the colours. */
const MARGIN = 1.5;
const [WIDTH, HEIGHT] = [320, 110];

/** Make the heading, the picture and its statistics. */
export function makeHistogram(distances: Float32Array, threshold: number, unit: string): (Element | string)[] {
  const isSigned = areSigned(distances);
  const sorted = distances.map(Math.abs).sort();
  const at = (share: number): number => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? 0;
  const end = MARGIN * chooseRange(distances, threshold);
  const counts = new Array<number>(BINS).fill(0);
  const start = isSigned ? -end : 0;
  for (const distance of distances) {
    const bin = Math.floor(((distance - start) / (end - start)) * BINS);
    if (bin >= 0 && bin < BINS) counts[bin] = (counts[bin] ?? 0) + 1;
  }
  const top = Math.max(...counts, 1);
  const width = WIDTH / BINS;
  const bars = counts.map((count, i) => {
    const height = (count / top) * HEIGHT;
    const middle = start + ((i + 0.5) / BINS) * (end - start);
    const [red, green, blue] = distanceColor(middle, end / MARGIN, isSigned);
    return svg("rect", { x: i * width, y: HEIGHT - height, width: width - 1, height, fill: `rgb(${red},${green},${blue})` });
  });
  const beyond = percent(distances.filter((distance) => Math.abs(distance) > end).length / (distances.length || 1));
  const statistics = `median ${short(at(0.5))}, 95 % within ${short(at(0.95))} ${unit}`;
  const picture = svg(
    "svg",
    { viewBox: `0 -4 ${WIDTH} ${HEIGHT + 24}`, role: "img", "aria-label": `Histogram of distances: ${statistics}`, class: "histogram" },
    ...bars,
    svg("text", { x: 0, y: HEIGHT + 15 }, short(start)),
    svg("text", { x: WIDTH, y: HEIGHT + 15, "text-anchor": "end" }, `${short(end)} ${unit}`),
  );
  return [
    h("h2", {}, "Distances"),
    picture,
    h("p", {}, `Of the moved source from the surface of the target${isSigned ? ", negative behind it" : ""}: ${statistics}.`),
    h("p", { className: "help" }, `${beyond} lie farther away than shown. Inliers lie within ${short(threshold)} ${unit} of a target point.`),
  ];
}
