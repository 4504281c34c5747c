/** Search by a clip, a range of it, or a file: every method, mirrored too. */
import { Button, Checkbox, NativeSelect } from "@mantine/core";
import { useEffect, useRef, useState } from "react";
import { post, type Answer, type Hit } from "./api";
import { Hits } from "./hits";
import { complain, lake, useStore } from "./store";
import type { Range } from "./timeline";

interface FindProps { clip?: string; upload?: string; range: Range | null; fps: number; onBeside?: (hit: Hit) => void; first?: Hit[]; asked?: number }

export function Find({ clip, upload, range, fps, onBeside, first, asked = 0 }: FindProps): React.JSX.Element {
  const methods = useStore(lake)?.search_methods ?? [];
  const [finds, setFinds] = useState<"clip" | "range">(range ? "range" : "clip");
  const [method, setMethod] = useState("default");
  const [k, setK] = useState("12");
  const [turned, setTurned] = useState(false);
  const [answer, setAnswer] = useState<(Answer & { text: string }) | null>(null);
  const [busy, setBusy] = useState(false);
  const stop = useRef<AbortController>(undefined);
  const ranged = Boolean(range);
  useEffect(() => setFinds(ranged ? "range" : "clip"), [ranged]);
  useEffect(() => { setAnswer(null); }, [clip, upload]);
  useEffect(() => () => stop.current?.abort(), []);
  const all = methods.filter((one) => one.finds === finds);
  const known = method === "default" || all.some((one) => one.name === method) ? method : "default";

  const send = async (): Promise<void> => {
    stop.current?.abort();
    stop.current = new AbortController();
    setBusy(true);
    try {
      const what = upload ? { upload } : { clip };
      const cut = range ? { from: range.from, to: range.to } : {};
      const found = await post<Answer>("search", { ...what, ...cut, method: known, finds, k: Number(k), mirrored: turned }, stop.current.signal);
      const of = range ? `frames ${range.from} to ${range.to}` : upload ? "the file" : "the clip";
      setAnswer({ ...found, text: `${found.hits.length} ${finds === "range" ? "ranges" : "clips"} like ${of}, in ${Math.max(1, Math.round(found.ms))} ms` });
    } catch (error) {
      complain(error);
    }
    setBusy(false);
  };
  const latest = useRef(send);
  latest.current = send;
  useEffect(() => { if (asked) void latest.current(); }, [asked]);

  return (
    <div className="find">
      <div className="find-fields">
        <NativeSelect size="xs" label="Look for" value={finds} onChange={(e) => setFinds(e.currentTarget.value as "clip" | "range")}
          data={[{ value: "clip", label: "Clips" }, { value: "range", label: "Ranges" }]} />
        <NativeSelect size="xs" label="By" value={known} onChange={(e) => setMethod(e.currentTarget.value)}
          data={[{ value: "default", label: "Default" }, ...all.filter((one) => one.name !== "default").map((one) => ({ value: one.name, label: one.title + (one.ready ? "" : " (not ready)"), disabled: !one.ready }))]} />
        <NativeSelect size="xs" label="Answers" value={k} onChange={(e) => setK(e.currentTarget.value)} data={["6", "12", "24", "50"]} />
      </div>
      <div className="find-go">
        <Checkbox size="xs" label="Mirrored too" checked={turned} onChange={(e) => setTurned(e.currentTarget.checked)} />
        <Button size="xs" className="go" aria-busy={busy} onClick={() => void send()}>{busy ? "Searching…" : range ? "Find the marked range" : upload ? "Find" : "Find clips like this"}</Button>
      </div>
      <p className="note" aria-live="polite">{answer ? answer.text : range ? `Marked: ${(range.from / fps).toFixed(2)} to ${(range.to / fps).toFixed(2)} s` : clip ? "Mark a range on the timeline to find it inside all clips." : ""}</p>
      {answer ? answer.hits.length ? <Hits hits={answer.hits} onBeside={onBeside} /> : <p className="note">Nothing was found.</p>
        : first && first.length > 0 && <><h3>Nearest clips</h3><Hits hits={first} onBeside={onBeside} judged={false} /></>}
    </div>
  );
}
