/** Small windows over a view: tags, labels, export, synthesis, keys. */
import { Button, NativeSelect, NumberInput, TextInput } from "@mantine/core";
import { useEffect, useRef, useState } from "react";
import { go } from "./address";
import { download, post } from "./api";
import { keysShown } from "./keys";
import { counted } from "./look";
import { complain, decide, lake, say, useStore } from "./store";

export function Dialog({ title, onClose, children }: { title: string; onClose: () => void; children: React.ReactNode }): React.JSX.Element {
  const box = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const dialog = box.current!;
    if (!dialog.open) dialog.showModal();
    dialog.querySelector<HTMLElement>("input, select")?.focus();
    return () => dialog.close();
  }, []);
  return (
    <dialog ref={box} aria-label={title} onCancel={(event) => { event.preventDefault(); onClose(); }}
      onClick={(event) => { if (event.target === box.current) onClose(); }}>
      <header><h2>{title}</h2><button type="button" className="plain" aria-label="Close" onClick={onClose}>✕</button></header>
      {children}
    </dialog>
  );
}

function clipsText(count: number): string {
  return count === 1 ? "1 clip" : `${counted(count)} clips`;
}

const WORDS = {
  tag: { verb: "Tag", past: "Tagged", field: "Tag" },
  label: { verb: "Label", past: "Labelled", field: "Label: what the motion shows" },
  segment: { verb: "Name the marked range of", past: "Named a range of", field: "Label: what the range shows" },
};

export function LabelDialog({ kind, clips, from, to, onClose }: {
  kind: keyof typeof WORDS; clips: string[]; from?: number; to?: number; onClose: () => void;
}): React.JSX.Element {
  const [value, setValue] = useState("");
  const [name, setName] = useState(localStorage.getItem("motionlake-who") ?? "");
  const send = async (event: React.FormEvent): Promise<void> => {
    event.preventDefault();
    if (!value.trim()) return;
    localStorage.setItem("motionlake-who", name.trim());
    if (await decide({ clips, kind, value: value.trim(), from, to }, `${WORDS[kind].past} ${clipsText(clips.length)} ${value.trim()}.`)) onClose();
  };
  return (
    <Dialog title={`${WORDS[kind].verb} ${clipsText(clips.length)}`} onClose={onClose}>
      <form onSubmit={(event) => void send(event)}>
        <TextInput label={WORDS[kind].field} value={value} onChange={(e) => setValue(e.currentTarget.value)} maxLength={200} required />
        <TextInput label="Who says so" placeholder="someone" value={name} onChange={(e) => setName(e.currentTarget.value)} maxLength={100} />
        <p className="note">Kept in the lake as a layer of its own; what came with the recording stays as it was.</p>
        <footer><Button size="xs" variant="default" onClick={onClose}>Cancel</Button><Button size="xs" type="submit">{kind === "segment" ? "Name" : WORDS[kind].verb}</Button></footer>
      </form>
    </Dialog>
  );
}

export interface Cut { clip: string; from?: number | null; to?: number | null }

export function ExportDialog({ clips, onClose }: { clips: Cut[]; onClose: () => void }): React.JSX.Element {
  const formats = useStore(lake)?.exports ?? [];
  const [format, setFormat] = useState(formats[0] ?? "");
  const [busy, setBusy] = useState(false);
  const send = async (event: React.FormEvent): Promise<void> => {
    event.preventDefault();
    setBusy(true);
    try {
      const size = await download("export", { clips, format }, `motionlake-${format}.zip`);
      say(`Exported ${clipsText(clips.length)} as ${format}: ${counted(Math.ceil(size / 1000))} kB.`);
      onClose();
    } catch (error) {
      complain(error);
    }
    setBusy(false);
  };
  return (
    <Dialog title={`Export ${clipsText(clips.length)}`} onClose={onClose}>
      <form onSubmit={(event) => void send(event)}>
        <NativeSelect label="Format" data={formats} value={format} onChange={(e) => setFormat(e.currentTarget.value)} />
        {clips.some((cut) => cut.from != null) && <p className="note">Only the marked range is cut out.</p>}
        <footer><Button size="xs" variant="default" onClick={onClose}>Cancel</Button><Button size="xs" type="submit" disabled={busy || !format}>{busy ? "Exporting…" : "Export"}</Button></footer>
      </form>
    </Dialog>
  );
}

export function MakeDialog({ like, onClose }: { like: string[]; onClose: () => void }): React.JSX.Element {
  const [length, setLength] = useState<string | number>(4);
  const [count, setCount] = useState<string | number>(1);
  const [seed, setSeed] = useState<string | number>(1);
  const [label, setLabel] = useState("");
  const [busy, setBusy] = useState(false);
  const send = async (event: React.FormEvent): Promise<void> => {
    event.preventDefault();
    setBusy(true);
    try {
      const what = label.trim() ? { class: label.trim() } : { like };
      const { clips } = await post<{ clips: { id: string }[] }>("synthesize", { ...what, seconds: Number(length), count: Number(count), seed: Number(seed) });
      onClose();
      go({ view: "clip", clip: like[0], made: clips.slice(0, 3).map((clip) => clip.id) });
    } catch (error) {
      complain(error);
      setBusy(false);
    }
  };
  return (
    <Dialog title="Make new motion" onClose={onClose}>
      <form onSubmit={(event) => void send(event)}>
        <p className="note">{`Like ${like.length === 1 ? like[0] : clipsText(like.length)}; shown beside its source. It needs the stage synth (motionlake run synth).`}</p>
        <TextInput label="Of a class instead (a label of the lake)" value={label} onChange={(e) => setLabel(e.currentTarget.value)} maxLength={200} />
        <div className="fields">
          <NumberInput label="Seconds" value={length} onChange={setLength} min={1} max={60} />
          <NumberInput label="How many" value={count} onChange={setCount} min={1} max={3} />
          <NumberInput label="Seed" value={seed} onChange={setSeed} min={0} />
        </div>
        <footer><Button size="xs" variant="default" onClick={onClose}>Cancel</Button><Button size="xs" type="submit" disabled={busy}>{busy ? "Making…" : "Make"}</Button></footer>
      </form>
    </Dialog>
  );
}

const SHOWN: Record<string, string> = { ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "Esc" };

export function KeysDialog({ onClose }: { onClose: () => void }): React.JSX.Element {
  const keys = keysShown();
  return (
    <Dialog title="Keys of this view" onClose={onClose}>
      <dl className="keys">
        {keys.map((key) => (
          <div key={key.keys + key.does}>
            <dt>{key.keys.split(" / ").map((one) => <kbd key={one}>{one.split("+").map((part) => SHOWN[part] ?? part).join(" + ") || "+"}</kbd>)}</dt>
            <dd>{key.does}</dd>
          </div>
        ))}
      </dl>
      <p className="note">Tab goes from control to control; letters do nothing while you write in a field. Press Esc to close.</p>
    </Dialog>
  );
}
