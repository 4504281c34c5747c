/** All clips: facets, search by text, a SQL condition, sorting, and the grid. */
import { Button, NativeSelect, TextInput } from "@mantine/core";
import { useEffect, useRef, useState } from "react";
import { change, useAddress } from "./address";
import { get, type Facets } from "./api";
import { FacetList } from "./facets";
import { Grid } from "./grid";
import { useKeys } from "./keys";
import { counted, useColours } from "./look";
import { filterOf, orderOf, useRows } from "./rows";
import { decided, generation, useLoaded, useStore } from "./store";
import { SelectionBar } from "./selection";

const SORTS = [
  { value: "clip", label: "Name" }, { value: "dataset", label: "Dataset" }, { value: "label", label: "Label" },
  { value: "subject", label: "Subject" }, { value: "rig", label: "Rig" }, { value: "seconds", label: "Length" },
  { value: "quality", label: "Quality" },
];

function Field({ name, label, placeholder, wait, refer }: {
  name: string; label: string; placeholder: string; wait: boolean; refer?: React.Ref<HTMLInputElement>;
}): React.JSX.Element {
  const at = useAddress();
  const there = at.get(name) ?? "";
  const [text, setText] = useState(there);
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  useEffect(() => setText(there), [there]);
  return (
    <TextInput ref={refer} size="xs" value={text} placeholder={placeholder} aria-label={label} className={`field ${name}`} spellCheck={false}
      onChange={(event) => {
        const value = event.currentTarget.value;
        setText(value);
        clearTimeout(timer.current);
        if (wait) timer.current = setTimeout(() => change({ [name]: value || null }, true), 250);
      }}
      onKeyDown={(event) => {
        if (event.key === "Enter") { clearTimeout(timer.current); change({ [name]: text || null }); }
        if (event.key === "Escape") event.currentTarget.blur();
      }} />
  );
}

export function Library(): React.JSX.Element {
  const at = useAddress();
  const colours = useColours();
  const version = useStore(generation) + useStore(decided);
  const query = orderOf(at).toString(), filter = filterOf(at).toString();
  const rows = useRows(query, version);
  const facets = useLoaded<Facets>(`${version}?${filter}`, (signal) => get("facets", new URLSearchParams(filter), signal));
  const [sql, setSql] = useState(at.has("where"));
  const field = useRef<HTMLInputElement>(null);
  useKeys([
    { keys: "/", does: "Search by text", act: () => field.current?.focus() },
    { keys: "q", does: "Show or hide the SQL condition", act: () => setSql(!sql) },
  ]);
  const error = rows.error ?? facets.error;
  return (
    <main className="collection">
      <FacetList facets={facets.value} at={at} />
      <div className="shelf">
        <div className="toolbar">
          <Field name="text" label="Search names, labels and tags" placeholder="Search names, labels, tags ( / )" wait refer={field} />
          <NativeSelect size="xs" data={SORTS} value={at.get("sort") ?? "clip"} aria-label="Sort by"
            onChange={(event) => change({ sort: event.currentTarget.value === "clip" ? null : event.currentTarget.value })} />
          <Button size="xs" variant="default" aria-pressed={at.has("descending")} onClick={() => change({ descending: !at.has("descending") })}>
            {at.has("descending") ? "Falling ↓" : "Rising ↑"}
          </Button>
          <Button size="xs" variant={sql ? "light" : "default"} aria-expanded={sql} onClick={() => setSql(!sql)}>SQL</Button>
          <output className="total" aria-live="polite">{rows.total === null ? "" : `${counted(rows.total)} clips`}</output>
        </div>
        {sql && (
          <div className="toolbar">
            <Field name="where" label="SQL condition" placeholder="A condition on the table clips, then Enter: seconds > 5 AND label LIKE '%kick%'" wait={false} />
          </div>
        )}
        {error ? <p className="message" role="alert">{error}</p>
          : rows.total === 0 ? <p className="message">No clip is like that. Take back a facet, or search for something else.</p>
          : <Grid rows={rows} query={query} colours={colours} />}
        <SelectionBar />
      </div>
    </main>
  );
}
