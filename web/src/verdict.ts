// The verdict on a result, in words, and its reasons.
import type { Result } from "./api";
import { listDeviations, short } from "./pose";

export type Trust = "trust" | "check" | "refuse";

export interface Verdict {
  trust: Trust;
  title: string;
  summary: string;
  reasons: { isGood: boolean; text: string }[];
}

/** Confidence from which on nobody needs to look. */
const SURE = 0.9;
/** Codes of warnings that tell of the files alone. */
const ABOUT_FILES = new Set(["file", "rows_not_finite", "rows_zeros", "rows_far", "rows_copies", "rows_shell"]);

export function judge(result: Result, unit: string): Verdict {
  const reasons = [...judgePose(result, unit), ...listWarnings(result)];
  const serious = result.warnings.some((warning) => !ABOUT_FILES.has(warning.code));
  if (!result.accepted) {
    return {
      trust: "refuse",
      title: "Do not use it",
      summary: "No pose was found that convinces. The reasons below say what to do.",
      reasons,
    };
  }
  if (result.confidence < SURE || result.ambiguous || result.free_directions.length || serious) {
    return {
      trust: "check",
      title: "Check it",
      summary: "The pose is likely right, but something about it needs a look.",
      reasons,
    };
  }
  return { trust: "trust", title: "Trust it", summary: "The clouds fit in this pose, and in no other.", reasons };
}

function judgePose(result: Result, unit: string): Verdict["reasons"] {
  const sigma = listDeviations(result);
  const isOne = !result.ambiguous && result.free_directions.length === 0;
  return [
    {
      isGood: result.confidence >= SURE,
      text: `Confidence ${percent(result.confidence)}: how likely this is the right pose; accepted from 50 % on.`,
    },
    {
      isGood: result.overlap >= 0.25,
      text: `${percent(result.overlap)} of the source lies over the target, ${short(result.rmse)} ${unit} from it (root mean square).`,
    },
    {
      isGood: isOne,
      text: isOne
        ? `The pose is sure to ${short(Math.max(...sigma.rotationDeg))}° and ${short(Math.max(...sigma.translation))} ${unit} (standard deviations).`
        : "The surfaces leave the pose open: other poses fit as well.",
    },
  ];
}

function listWarnings(result: Result): Verdict["reasons"] {
  return result.warnings.map(({ message }) => ({ isGood: false, text: message }));
}

export function percent(share: number): string {
  const value = share * 100;
  return `${value > 99 && value < 100 ? Math.floor(value * 10) / 10 : Math.round(value)} %`;
}
