/** The frame around all views: where they are opened, what runs, what was said. */
import { useComputedColorScheme, useMantineColorScheme } from "@mantine/core";
import { lazy, Suspense, useEffect, useRef, useState } from "react";
import { follow, go, link, useAddress } from "./address";
import { KeysDialog } from "./dialogs";
import { DropFile } from "./drop";
import { useKeys } from "./keys";
import { Library } from "./library";
import { counted } from "./look";
import { failed, lake, progress, said, start, undo, useStore } from "./store";

const ClipPage = lazy(() => import("./clip"));
const MapPage = lazy(() => import("./map"));
const WorkPage = lazy(() => import("./work"));
const UploadPage = lazy(() => import("./upload"));

const VIEWS = [["library", "Library"], ["map", "Map"], ["work", "Work"]] as const;

function RunProgress(): React.JSX.Element {
  const run = useStore(progress);
  if (!run) return <div className="run" />;
  const left = run.seconds_left == null ? "" : run.seconds_left < 90 ? `, ${Math.ceil(run.seconds_left)} s left` : `, ${Math.ceil(run.seconds_left / 60)} min left`;
  return (
    <div className="run" role="status">
      <span>{`Run: ${run.stage}, ${counted(run.done)} of ${counted(run.total)}${left}`}</span>
      <progress value={run.done} max={Math.max(1, run.total)} aria-label="Progress of the run" />
    </div>
  );
}

function Header({ view, onKeys }: { view: string; onKeys: () => void }): React.JSX.Element {
  const about = useStore(lake);
  const scheme = useComputedColorScheme("light");
  const { setColorScheme } = useMantineColorScheme({ keepTransitions: true });
  const flip = (): void => setColorScheme(scheme === "dark" ? "light" : "dark");
  useKeys([
    { keys: "1", does: "Open the library", act: () => go({}) },
    { keys: "2", does: "Open the map", act: () => go({ view: "map" }) },
    { keys: "3", does: "Open the work", act: () => go({ view: "work" }) },
    { keys: "d", does: "Dark or light", act: flip },
    { keys: "?", does: "These keys", act: onKeys },
  ]);
  return (
    <header className="head">
      <a className="brand" href="/" onClick={follow}>motionlake</a>
      <nav aria-label="Views">
        {VIEWS.map(([name, title]) => (
          <a key={name} href={link(name === "library" ? {} : { view: name })} onClick={follow} aria-current={view === name ? "page" : undefined}>{title}</a>
        ))}
      </nav>
      <span className="lake-name" title={about?.name}>{about ? `${about.name}: ${counted(about.clips)} clips${about.read_only ? ", for reading alone" : ""}` : ""}</span>
      <RunProgress />
      <button type="button" className="plain" onClick={flip}>{scheme === "dark" ? "Light" : "Dark"}</button>
      <button type="button" className="plain" onClick={onKeys} aria-label="Keys (?)">Keys ?</button>
    </header>
  );
}

function Sayings(): React.JSX.Element {
  const all = useStore(said);
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => { // above a dialog that is open
    const element = box.current!;
    if (element.matches(":popover-open")) element.hidePopover();
    if (all.length) element.showPopover();
  }, [all]);
  return (
    <div ref={box} popover="manual" className="sayings" role="status" aria-live="polite">
      {all.map((one) => (
        <p key={one.id} className={one.kind}>
          {one.text}
          {one.undo && <button type="button" className="plain" onClick={() => void undo(one.undo)}>Undo</button>}
          <button type="button" className="plain" aria-label="Close" onClick={() => said.set(said.get().filter((other) => other !== one))}>✕</button>
        </p>
      ))}
    </div>
  );
}

export function App(): React.JSX.Element {
  const at = useAddress();
  const about = useStore(lake);
  const [error, setError] = useState<string | null>(null);
  const [keys, setKeys] = useState(false);
  const view = at.get("view") ?? "library";
  useEffect(() => { start().catch((problem: unknown) => setError(failed(problem))); }, []);
  useEffect(() => {
    const clip = at.get("clip");
    document.title = [view === "clip" ? clip : view, about?.name, "motionlake"].filter(Boolean).join(" · ");
  }, [at, view, about]);
  const page = view === "clip" ? <ClipPage /> : view === "map" ? <MapPage /> : view === "work" ? <WorkPage /> : view === "upload" ? <UploadPage /> : <Library />;
  return (
    <>
      <Header view={view} onKeys={() => setKeys(true)} />
      {error ? <p className="message" role="alert">{error}</p>
        : about ? <Suspense fallback={<main className="waiting-page" />}>{page}</Suspense> : <main className="waiting-page" />}
      <Sayings />
      <DropFile />
      {keys && <KeysDialog onClose={() => setKeys(false)} />}
    </>
  );
}
