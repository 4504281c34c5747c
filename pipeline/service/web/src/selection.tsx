/** What can be done with the clips that are selected: below the grid, always in the same place. */
import { Button } from "@mantine/core";
import { useState } from "react";
import { go } from "./address";
import { ExportDialog, LabelDialog, MakeDialog } from "./dialogs";
import { useKeys } from "./keys";
import { counted } from "./look";
import { lake, select, selection, undo, useStore } from "./store";

type Open = "tag" | "label" | "export" | "make" | null;

export function SelectionBar(): React.JSX.Element {
  const chosen = [...useStore(selection)];
  const about = useStore(lake);
  const [open, setOpen] = useState<Open>(null);
  const fixed = about?.read_only ?? false;
  const none = chosen.length === 0;
  const beside = chosen.length >= 2 && chosen.length <= 4;
  const when = (what: Open) => () => { if (chosen.length && (!fixed || what === "export" || what === "make")) setOpen(what); };
  const compare = (): void => { if (beside) go({ view: "clip", clip: chosen[0], beside: chosen.slice(1) }); };
  useKeys([
    { keys: "t", does: "Tag what is selected", act: when("tag") },
    { keys: "l", does: "Label what is selected", act: when("label") },
    { keys: "e", does: "Export what is selected", act: when("export") },
    { keys: "m", does: "Make new motion like what is selected", act: when("make") },
    { keys: "b", does: "Play two to four selected clips side by side", act: compare },
    { keys: "u / Ctrl+z", does: "Undo the last decision", act: () => void undo() },
  ]);
  const why = fixed ? "This lake is open for reading alone." : undefined;
  return (
    <div className="selection" role="toolbar" aria-label="Selection">
      <output>{none ? "Nothing selected: click the corner of a clip, or press Space" : `${counted(chosen.length)} selected`}</output>
      <Button size="xs" variant="default" disabled={none || fixed} title={why} onClick={when("tag")}>Tag</Button>
      <Button size="xs" variant="default" disabled={none || fixed} title={why} onClick={when("label")}>Label</Button>
      <Button size="xs" variant="default" disabled={!beside} onClick={compare}>Side by side</Button>
      <Button size="xs" variant="default" disabled={none} onClick={when("export")}>Export</Button>
      <Button size="xs" variant="default" disabled={none} onClick={when("make")}>Make like these</Button>
      <Button size="xs" variant="subtle" disabled={none} onClick={() => select([])}>Clear</Button>
      {(open === "tag" || open === "label") && <LabelDialog kind={open} clips={chosen} onClose={() => setOpen(null)} />}
      {open === "export" && <ExportDialog clips={chosen.map((clip) => ({ clip }))} onClose={() => setOpen(null)} />}
      {open === "make" && <MakeDialog like={chosen} onClose={() => setOpen(null)} />}
    </div>
  );
}
