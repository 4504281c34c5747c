/** Facets with counts, beside the grid. */
import { Checkbox } from "@mantine/core";
import { memo, useState } from "react";
import { change, numberAt } from "./address";
import type { FacetSpan, FacetValue, Facets } from "./api";
import { counted } from "./look";
import { FACETS, PARAMETERS } from "./rows";

const SHORT = 6;
const NOTHING: Record<string, string> = { label: "no label", subject: "no subject", licence: "no licence", quality: "not judged" };

function written(column: string, value: FacetValue["value"]): string {
  if (column === "synthetic") return String(value) === "true" || String(value) === "1" ? "made" : "recorded";
  return value === null || value === "" ? NOTHING[column] ?? "none" : String(value);
}

function flipped(at: URLSearchParams, column: string, value: string): string[] {
  const now = at.getAll(column);
  return now.includes(value) ? now.filter((one) => one !== value) : [...now, value];
}

function Values({ column, values, at }: { column: string; values: FacetValue[]; at: URLSearchParams }): React.JSX.Element {
  const [all, setAll] = useState(false);
  const chosen = at.getAll(column);
  const first = values.filter((v, i) => all || i < SHORT || chosen.includes(String(v.value ?? "")));
  return (
    <>
      <ul>
        {first.map((v) => {
          const value = String(v.value ?? "");
          return (
            <li key={value}>
              <Checkbox size="xs" checked={chosen.includes(value)} label={<><span className="name" title={value}>{written(column, v.value)}</span><span className="count">{counted(v.clips)}</span></>}
                onChange={() => change({ [column]: flipped(at, column, value) })} />
            </li>
          );
        })}
      </ul>
      {values.length > SHORT && (
        <button type="button" className="plain" onClick={() => setAll(!all)}>{all ? "Fewer" : `All ${counted(values.length)}`}</button>
      )}
    </>
  );
}

function shortly(value: number): string {
  return value < 10 ? String(Math.round(10 * value) / 10) : String(Math.round(value));
}

/** Lengths: one bar chosen, or with Shift all bars up to there. */
function Lengths({ spans, at }: { spans: FacetSpan[]; at: URLSearchParams }): React.JSX.Element {
  const most = Math.max(1, ...spans.map((span) => span.clips));
  const from = numberAt(at, "seconds_from"), to = numberAt(at, "seconds_to");
  const timed = from !== null || to !== null;
  const inside = (span: FacetSpan): boolean => timed && span.from >= (from ?? 0) - 1e-6 && span.to <= (to ?? Infinity) + 1e-6;
  const pick = (span: FacetSpan, extend: boolean): void => {
    if (extend && timed) return change({ seconds_from: Math.min(from ?? 0, span.from), seconds_to: Math.max(to ?? 0, span.to) });
    const same = from === span.from && to === span.to;
    change({ seconds_from: same ? null : span.from, seconds_to: same ? null : span.to });
  };
  return (
    <div role="group" aria-label="Lengths">
      <div className="histogram">
      {spans.map((span) => {
        const text = `${shortly(span.from)} to ${shortly(span.to)} s: ${counted(span.clips)} clips (Shift+click: up to there)`;
        return (
          <button type="button" key={span.from} title={text} aria-label={text} aria-pressed={inside(span)} onClick={(event) => pick(span, event.shiftKey)}>
            <span style={{ height: `${span.clips ? Math.max(4, (100 * span.clips) / most) : 0}%` }} />
          </button>
        );
      })}
      </div>
      <div className="ends"><small>{shortly(spans[0]!.from)} s</small><small>{shortly(spans.at(-1)!.to)} s</small></div>
    </div>
  );
}

export const FacetList = memo(function FacetList({ facets, at }: { facets: Facets | null; at: URLSearchParams }): React.JSX.Element {
  const any = PARAMETERS.some((name) => at.has(name));
  return (
    <nav className="facets" aria-label="Facets">
      <div className="facets-head"><h2>Narrow down</h2>
        <button type="button" className="plain" disabled={!any} onClick={() => change(Object.fromEntries(PARAMETERS.map((name) => [name, null])))}>Clear</button>
      </div>
      {FACETS.map(([column, title]) => {
        const values = facets?.[column];
        if (values && !values.length) return null;
        return (
          <section key={column}>
            <h3>{title}</h3>
            {!values ? <div className="waiting" /> : "from" in values[0]!
              ? <Lengths spans={values as FacetSpan[]} at={at} />
              : <Values column={column} values={values as FacetValue[]} at={at} />}
          </section>
        );
      })}
    </nav>
  );
});
