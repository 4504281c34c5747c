/** What is known of a clip: where it comes from, under which licence, what is wrong with it, what people decided. */
import type { Annotation, ClipAbout } from "./api";
import { seconds } from "./look";
import { lake, undo, useStore } from "./store";

function told(value: unknown): string {
  if (value === null || value === undefined || value === "") return "";
  if (Array.isArray(value)) return value.map(told).filter(Boolean).join(", ");
  if (typeof value === "object") return Object.entries(value).map(([name, v]) => `${name}: ${told(v)}`).join("; ");
  if (typeof value === "boolean") return value ? "yes" : "no";
  return typeof value === "number" && !Number.isInteger(value) ? value.toFixed(3) : String(value);
}

function Facts({ facts }: { facts: [string, unknown][] }): React.JSX.Element {
  const there = facts.map(([name, value]) => [name, told(value)] as const).filter(([, text]) => text);
  return <dl className="facts-list">{there.map(([name, text]) => <div key={name}><dt>{name.replaceAll("_", " ")}</dt><dd>{text}</dd></div>)}</dl>;
}

export function AnnotationList({ annotations }: { annotations: readonly Annotation[] }): React.JSX.Element {
  const fixed = useStore(lake)?.read_only ?? false;
  return (
    <ul className="decisions">
      {annotations.map((one) => (
        <li key={one.id} className={one.undone_at ? "undone" : ""}>
          <span><b>{one.kind}</b> {one.value}{one.from != null && ` (frames ${one.from} to ${one.to})`}</span>
          <small>{one.who || "someone"}, {one.made_at.slice(0, 16).replace("T", " ")}{one.undone_at && ", undone"}</small>
          {!one.undone_at && !fixed && <button type="button" className="plain" onClick={() => void undo([one.id])}>Undo</button>}
        </li>
      ))}
    </ul>
  );
}

export function About({ about, onSeek }: { about: ClipAbout; onSeek: (frame: number) => void }): React.JSX.Element {
  const { label: _label, subject: _subject, ...labels } = about.labels ?? {};
  return (
    <div className="about">
      <Facts facts={[["label", about.label || "no label"], ["dataset", about.dataset], ["subject", about.subject], ["length", `${seconds(about.seconds)}, ${about.frames} frames at ${about.fps.toFixed(about.fps % 1 ? 2 : 0)} a second`], ["rig", about.rig], ["quality", about.quality], ["tags", about.tags]]} />
      <h3>Licence</h3>
      {about.licence?.licences?.length ? <p>{about.licence.licences.join("; ")}</p> : <p className="note">None is known. Ask whoever gave the dataset {about.dataset}.</p>}
      <h3>Lineage</h3>
      {about.synthetic ? <Facts facts={Object.entries(about.lineage)} /> : <Facts facts={[["made", "recorded, not synthesized"], ...Object.entries(about.file ?? {})]} />}
      {Object.values(labels).some((v) => told(v)) && <><h3>Labels of the source</h3><Facts facts={Object.entries(labels)} /></>}
      {about.faults.length > 0 && (
        <>
          <h3>Faults</h3>
          <ul className="decisions">
            {about.faults.slice(0, 50).map((fault, i) => (
              <li key={i}><button type="button" className="plain" onClick={() => onSeek(fault.start)}>{`${fault.fault}${fault.joint ? `, ${fault.joint}` : ""}`.replaceAll("_", " ")}, frames {fault.start} to {fault.stop}</button></li>
            ))}
          </ul>
        </>
      )}
      <h3>Decided by people</h3>
      {about.annotations.length ? <AnnotationList annotations={about.annotations} /> : <p className="note">Nothing yet.</p>}
    </div>
  );
}
