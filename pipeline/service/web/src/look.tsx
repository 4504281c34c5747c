/** Dark and light, as the system says or as a person chooses. */
import { useComputedColorScheme } from "@mantine/core";
import { DARK, LIGHT, type Colours } from "./colours";

export function useColours(): Colours {
  return useComputedColorScheme("light") === "dark" ? DARK : LIGHT;
}

export function seconds(value: number): string {
  return value < 60 ? `${value.toFixed(1)} s` : `${Math.floor(value / 60)}:${String(Math.floor(value % 60)).padStart(2, "0")} min`;
}
export function counted(value: number): string {
  return value.toLocaleString("en-GB");
}
