/** The grid of clips: only the rows on the screen exist, however many there are. */
import { useVirtualizer } from "@tanstack/react-virtual";
import { memo, useCallback, useEffect, useRef, useState } from "react";
import { follow, go, link } from "./address";
import type { ClipRow } from "./api";
import type { Colours } from "./colours";
import { useKeys } from "./keys";
import { seconds } from "./look";
import type { Rows } from "./rows";
import { complain, select, selection, toggle, useStore } from "./store";
import { Thumb } from "./thumb";

const LEAST = 172, GAP = 10, PICTURE = 132, TEXT = 54, BEYOND = 2;
export const ROW = PICTURE + TEXT + GAP;

interface CardProps {
  row: ClipRow | undefined; index: number; width: number; chosen: boolean; current: boolean; colours: Colours;
  onPick: (index: number, event: React.MouseEvent) => void;
}

const Card = memo(function Card({ row, index, width, chosen, current, colours, onPick }: CardProps): React.JSX.Element {
  const [pointed, setPointed] = useState(false);
  if (!row) return <div className="card empty" role="gridcell" style={{ width }} />;
  const about = [row.label || "no label", row.dataset, row.subject, seconds(row.seconds)].filter(Boolean).join(", ");
  return (
    <div role="gridcell" aria-selected={chosen} id={`card-${index}`} style={{ width }} title={`${row.clip}\n${about}`}
      className={`card${chosen ? " chosen" : ""}${current ? " current" : ""}`}
      onPointerEnter={() => setPointed(true)} onPointerLeave={() => setPointed(false)}
      onClickCapture={(event) => {
        if (event.ctrlKey || event.metaKey || event.shiftKey || (event.target as HTMLElement).closest(".pick")) {
          event.preventDefault();
          event.stopPropagation();
          onPick(index, event);
        }
      }}>
      <a href={link({ view: "clip", clip: row.clip })} onClick={follow} tabIndex={-1} draggable={false}>
        <Thumb clip={row.clip} width={width - 2} height={PICTURE} colours={colours} playing={pointed || current} />
        <span className="label">{row.label || <i>no label</i>}</span>
        <span className="clip-name"><bdi>{row.clip}</bdi></span>
        <span className="facts">
          {seconds(row.seconds)}{row.quality && ` · ${row.quality}`}
          {row.synthetic && " · made"}{row.tags.length > 0 && ` · ${row.tags.join(", ")}`}
        </span>
      </a>
      <button type="button" className="pick" tabIndex={-1} aria-label={chosen ? `Unselect ${row.clip}` : `Select ${row.clip}`} />
    </div>
  );
});

interface GridProps { rows: Rows; query: string; colours: Colours }

export function Grid({ rows, query, colours }: GridProps): React.JSX.Element {
  const box = useRef<HTMLDivElement>(null);
  const [{ width, height }, setSize] = useState({ width: 0, height: 0 });
  const [current, setCurrent] = useState(-1);
  const [focused, setFocused] = useState(false);
  const anchor = useRef(0);
  const chosen = useStore(selection);
  const total = rows.total ?? 24;
  const columns = Math.max(1, Math.floor((width + GAP) / (LEAST + GAP)));
  const card = Math.floor((width - (columns - 1) * GAP) / columns);
  const lines = Math.ceil(total / columns);

  useEffect(() => {
    const watch = new ResizeObserver(([entry]) => {
      const { width, height } = entry!.contentRect;
      setSize({ width: Math.floor(width), height: Math.floor(height) });
    });
    watch.observe(box.current!);
    return () => watch.disconnect();
  }, []);

  // As many rows at every moment: the elements of one that leaves the screen are used again for the one that comes.
  const slots = Math.ceil(height / ROW) + 1 + 2 * BEYOND;
  const rangeExtractor = useCallback(({ startIndex, count }: { startIndex: number; count: number }): number[] => {
    const first = Math.max(0, Math.min(startIndex - BEYOND, count - slots));
    return Array.from({ length: Math.min(slots, count) }, (_, i) => first + i);
  }, [slots]);
  const virtual = useVirtualizer({ count: lines, getScrollElement: () => box.current, estimateSize: () => ROW, rangeExtractor });
  const items = virtual.getVirtualItems();
  const first = (items[0]?.index ?? 0) * columns, last = Math.min(total - 1, ((items.at(-1)?.index ?? 5) + 1) * columns - 1);
  useEffect(() => { if (width) rows.show(first, Math.max(first, last)); }, [rows, first, last, width]);
  useEffect(() => {
    box.current?.scrollTo(0, 0);
    setCurrent(-1);
    anchor.current = 0;
  }, [query]);

  const reach = useCallback((index: number, start: number, add: boolean): void => {
    const [low, high] = [Math.min(index, start), Math.max(index, start)];
    rows.names(low, high).then((names) => select(add ? [...selection.get(), ...names] : names), complain);
  }, [rows]);

  const onPick = useCallback((index: number, event: React.MouseEvent): void => {
    const row = rows.at(index);
    if (!row) return;
    setCurrent(index);
    if (event.shiftKey) return reach(index, anchor.current, event.ctrlKey || event.metaKey);
    anchor.current = index;
    toggle(row.clip);
  }, [rows, reach]);

  const step = (by: number, extend: boolean): void => {
    box.current?.focus({ preventScroll: true });
    const next = Math.min(total - 1, Math.max(0, current < 0 ? 0 : current + by));
    setCurrent(next);
    virtual.scrollToIndex(Math.floor(next / columns), { align: "auto" });
    if (extend) reach(next, anchor.current, false);
    else anchor.current = next;
  };
  const at = (act: (row: ClipRow) => void) => () => {
    const row = rows.at(current);
    if (row) act(row);
  };
  useKeys([
    { keys: "ArrowRight / ArrowLeft / ArrowDown / ArrowUp", does: "Go from clip to clip", act: (e) => step(e.key === "ArrowRight" ? 1 : e.key === "ArrowLeft" ? -1 : e.key === "ArrowDown" ? columns : -columns, false) },
    { keys: "PageDown / PageUp", does: "Go on by a screen", act: (e) => step((e.key === "PageDown" ? 1 : -1) * columns * Math.max(1, Math.floor((box.current?.clientHeight ?? ROW) / ROW)), false) },
    { keys: "Home / End", does: "Go to the first or last clip", act: (e) => step(e.key === "Home" ? -total : total, false) },
    { keys: "Enter", does: "Open the clip", act: at((row) => go({ view: "clip", clip: row.clip })) },
    { keys: "Space / x", does: "Select the clip, or no longer", act: at((row) => { anchor.current = current; toggle(row.clip); }) },
    { keys: "Shift+ArrowRight / Shift+ArrowLeft / Shift+ArrowDown / Shift+ArrowUp", does: "Select on from clip to clip", act: (e) => step(e.key === "ArrowRight" ? 1 : e.key === "ArrowLeft" ? -1 : e.key === "ArrowDown" ? columns : -columns, true) },
    { keys: "Ctrl+a", does: "Select all clips of the view (10,000 at most)", act: () => reach(Math.min(total, 10_000) - 1, 0, false) },
    { keys: "Escape", does: "Select nothing", act: () => select([]) },
  ]);

  return (
    <div ref={box} className="grid" role="grid" tabIndex={0} aria-label="Clips" aria-rowcount={lines} aria-multiselectable="true"
      aria-activedescendant={current >= 0 ? `card-${current}` : undefined}
      onFocus={() => { setFocused(true); if (current < 0) setCurrent(first); }} onBlur={() => setFocused(false)}>
      <div className="grid-inner" style={{ height: virtual.getTotalSize() }} role="presentation">
        {width > 0 && items.map((item) => (
          <div key={item.index % slots} role="row" aria-rowindex={item.index + 1} className="grid-row" style={{ transform: `translateY(${item.start}px)`, gap: GAP }}>
            {Array.from({ length: Math.min(columns, total - item.index * columns) }, (_, i) => {
              const index = item.index * columns + i;
              const row = rows.at(index);
              return <Card key={i} index={index} row={row} width={card} colours={colours} onPick={onPick}
                chosen={row !== undefined && chosen.has(row.clip)} current={focused && index === current} />;
            })}
          </div>
        ))}
      </div>
    </div>
  );
}
