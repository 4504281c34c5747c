/** A file of motion as a query. */
import { useEffect, useMemo } from "react";
import { useAddress } from "./address";
import { Clock } from "./clock";
import { Find } from "./find";
import { useColours } from "./look";
import { useMotions } from "./motions";
import { Players, type Pane } from "./players";
import type { Shows } from "./scene";

const SHOWS: Shows = { contacts: true, trails: true, path: true, ground: true };

export default function UploadPage(): React.JSX.Element {
  const at = useAddress();
  const upload = at.get("upload") ?? "", name = at.get("name") ?? "file";
  const colours = useColours();
  const clock = useMemo(() => new Clock(), []);
  const sources = useMemo(() => [{ upload }], [upload]);
  const motions = useMotions(sources);
  const motion = motions[0]?.motion ?? null;
  const panes = useMemo<Pane[]>(() => [{ key: upload, motion, time: (now) => now }], [upload, motion]);
  useEffect(() => {
    if (motion) { clock.length = motion.frames / motion.fps; clock.fps = motion.fps; clock.play(true); }
    return () => clock.stop();
  }, [motion, clock]);
  return (
    <main className="clip-page">
      <section className="theatre" aria-label="Player">
        <div className="theatre-head"><h1>File <span>{name}</span></h1></div>
        <p className="note">Kept while the service runs, outside the lake. Drop another file to search by that one.</p>
        <div className="stage-box">
          <Players panes={panes} clock={clock} shows={SHOWS} follow colours={colours} label={`Motion of ${name}`} />
          {motions[0]?.error && <p className="message">The file itself cannot be shown; what is like it stands beside.</p>}
        </div>
      </section>
      <aside><div className="side"><Find upload={upload} range={null} fps={motion?.fps ?? 30} asked={1} /></div></aside>
    </main>
  );
}
