/** A file dropped on any view is a query. */
import { useEffect, useState } from "react";
import { go } from "./address";
import { postFile } from "./api";
import { complain, say } from "./store";

export async function sendFile(file: File): Promise<void> {
  const slow = setTimeout(() => say(`Reading ${file.name}.`), 700);
  try {
    const made = await postFile<{ id: string; frames: number; fps: number; rig: string }>("uploads", { name: file.name }, file);
    go({ view: "upload", upload: made.id, name: file.name });
  } catch (error) {
    complain(error);
  }
  clearTimeout(slow);
}

export function DropFile(): React.JSX.Element | null {
  const [over, setOver] = useState(false);
  useEffect(() => {
    let depth = 0;
    const files = (event: DragEvent): boolean => event.dataTransfer?.types.includes("Files") ?? false;
    const enter = (event: DragEvent): void => { if (files(event)) { depth++; setOver(true); } };
    const leave = (event: DragEvent): void => { if (files(event) && --depth <= 0) { depth = 0; setOver(false); } };
    const move = (event: DragEvent): void => { if (files(event)) event.preventDefault(); };
    const drop = (event: DragEvent): void => {
      if (!files(event)) return;
      event.preventDefault();
      depth = 0;
      setOver(false);
      const file = event.dataTransfer!.files[0];
      if (file) void sendFile(file);
    };
    const all = [["dragenter", enter], ["dragleave", leave], ["dragover", move], ["drop", drop]] as const;
    for (const [name, heard] of all) window.addEventListener(name, heard);
    return () => { for (const [name, heard] of all) window.removeEventListener(name, heard); };
  }, []);
  return over ? <div className="drop">Drop a file of motion here, to find what is like it</div> : null;
}
