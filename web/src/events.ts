// The events of a registration until it ends: by stream, and again from the last one after a break.
import { call, ApiError, isEnded, type Status } from "./api";

export interface ProgressEvent {
  status: Status;
  stage: string;
  fraction: number;
}

const PAUSE_MS = 1000;
const MAX_BREAKS = 20;

/** Call `onEvent` for each change; return when the registration has ended. */
export async function followEvents(
  path: string,
  onEvent: (event: ProgressEvent) => void,
  signal: AbortSignal,
): Promise<void> {
  let last = "0";
  for (let breaks = 0; breaks <= MAX_BREAKS; breaks++) {
    try {
      const response = await call(`${path}/events`, { headers: { "Last-Event-ID": last }, signal });
      for await (const { id, data } of readEvents(response)) {
        last = id || last;
        breaks = 0;
        const event = JSON.parse(data) as ProgressEvent;
        onEvent(event);
        if (isEnded(event.status)) return;
      }
      return; // the end was told before, or the registration is deleted
    } catch (error) {
      if (signal.aborted) throw error;
      const mayPass = !(error instanceof ApiError) || error.problem.status === 0 || error.problem.status >= 500;
      if (!mayPass || breaks === MAX_BREAKS) throw error;
      await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
    }
  }
}

async function* readEvents(response: Response): AsyncGenerator<{ id: string; data: string }> {
  if (!response.body) return;
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    text = (text + value).replaceAll("\r\n", "\n");
    const blocks = text.split("\n\n");
    text = blocks.pop() ?? "";
    for (const block of blocks) {
      const data = readField(block, "data");
      if (data) yield { id: readField(block, "id"), data };
    }
  }
}

function readField(block: string, name: string): string {
  const lines = block.split("\n").filter((line) => line.startsWith(`${name}:`));
  return lines.map((line) => line.slice(name.length + 1).trimStart()).join("\n");
}
