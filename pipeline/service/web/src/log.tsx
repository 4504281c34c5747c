/** All that people decided: undone again, or taken away as labels.csv and segments.csv. */
import { Button, Checkbox, NativeSelect, TextInput } from "@mantine/core";
import { useState } from "react";
import { follow } from "./address";
import { download, get, type Annotation } from "./api";
import { hitLink } from "./hits";
import { useKeys } from "./keys";
import { counted } from "./look";
import { complain, decided, generation, lake, undo, useLoaded, useStore } from "./store";

export function AnnotationTable(): React.JSX.Element {
  const version = useStore(generation) + useStore(decided);
  const about = useStore(lake);
  const [undone, setUndone] = useState(false);
  const [kind, setKind] = useState("");
  const [dataset, setDataset] = useState("");
  const [name, setName] = useState(localStorage.getItem("motionlake-who") ?? "");
  const found = useLoaded<{ total?: number; annotations: Annotation[] }>(`${version} ${undone} ${kind}`, (signal) => get("annotations", { undone, kind: kind || null, limit: 1000 }, signal));
  const take = (what: "labels" | "segments") => () => {
    const query = new URLSearchParams({ kind: what, ...(dataset ? { dataset } : {}) });
    download(`annotations/export?${query.toString()}`, null, `${what}.csv`).catch(complain);
  };
  useKeys([{ keys: "u / Ctrl+z", does: "Undo the last decision", act: () => void undo() }]);
  const rows = found.value?.annotations ?? [];
  return (
    <>
      <div className="log-head">
        <NativeSelect size="xs" label="Kind" value={kind} onChange={(e) => setKind(e.currentTarget.value)} data={[{ value: "", label: "All" }, "tag", "label", "segment", "accept", "reject", "duplicate", "fault"]} />
        <Checkbox size="xs" label="Undone ones too" checked={undone} onChange={() => setUndone(!undone)} />
        <TextInput size="xs" label="Your name, written beside what you decide" placeholder="someone" value={name} maxLength={100}
          onChange={(e) => { setName(e.currentTarget.value); localStorage.setItem("motionlake-who", e.currentTarget.value.trim()); }} />
        <span className="spring" />
        <NativeSelect size="xs" label="Dataset" value={dataset} onChange={(e) => setDataset(e.currentTarget.value)} data={[{ value: "", label: "All" }, ...(about?.datasets ?? [])]} />
        <Button size="xs" variant="default" onClick={take("labels")}>labels.csv</Button>
        <Button size="xs" variant="default" onClick={take("segments")}>segments.csv</Button>
      </div>
      {found.error ? <p className="message" role="alert">{found.error}</p> : found.value && !rows.length ? <p className="message">Nobody has decided anything yet. Tags, labels and what you accept or reject appear here.</p> : (
        <table className="log">
          <thead><tr><th>Kind</th><th>Clip</th><th>Value</th><th>Frames</th><th>Who</th><th>When</th><th><span className="total">{rows.length ? counted(found.value?.total ?? rows.length) : ""}</span></th></tr></thead>
          <tbody>{rows.map((one) => (
            <tr key={one.id} className={one.undone_at ? "undone" : ""}>
              <td>{one.kind}</td><td><a href={hitLink(one)} onClick={follow}>{one.clip}</a></td><td>{one.value}</td>
              <td>{one.from != null ? `${one.from} to ${one.to}` : ""}</td><td>{one.who || "someone"}</td><td>{one.made_at.slice(0, 16).replace("T", " ")}</td>
              <td>{one.undone_at ? "undone" : !about?.read_only && <button type="button" className="plain" onClick={() => void undo([one.id])}>Undo</button>}</td>
            </tr>
          ))}</tbody>
        </table>
      )}
    </>
  );
}
