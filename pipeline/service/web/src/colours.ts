/** Colours that readers with any colour vision tell apart: the palette of Okabe and Ito. */
export const PALETTE = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999"] as const;

export interface Colours {
  dark: boolean; ink: string; faint: string; paper: string; panel: string; edge: string; accent: string;
  left: string; right: string; body: string; contact: string;
}

export const LIGHT: Colours = {
  dark: false, ink: "#1f2328", faint: "#5c636b", paper: "#ffffff", panel: "#f4f5f7", edge: "#d5d9de", accent: "#0072b2",
  left: "#0072b2", right: "#d55e00", body: "#6b7178", contact: "#009e73",
};
export const DARK: Colours = {
  dark: true, ink: "#e6e8ea", faint: "#a3a9b0", paper: "#16181b", panel: "#1f2226", edge: "#3a3f45", accent: "#56b4e9",
  left: "#56b4e9", right: "#e69f00", body: "#b3b8be", contact: "#2fc79a",
};

/** Black or white, whichever is read more easily on a colour. */
export function inkOn(colour: string): string {
  const [r, g, b] = [1, 3, 5].map((i) => {
    const c = parseInt(colour.slice(i, i + 2), 16) / 255;
    return c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.19 ? "#000000" : "#ffffff";
}

export function colourOf(index: number): string {
  return PALETTE[((index % PALETTE.length) + PALETTE.length) % PALETTE.length]!;
}

/** From dark blue to yellow, as light as the number is large (0 to 1): told apart without colours too. */
export function shade(share: number): string {
  const stops = [[0, 32, 76], [87, 93, 109], [165, 156, 116], [255, 234, 70]] as const;
  const place = Math.min(0.9999, Math.max(0, share)) * (stops.length - 1);
  const low = stops[Math.floor(place)]!, high = stops[Math.floor(place) + 1]!, part = place % 1;
  return `#${low.map((v, i) => Math.round(v + part * (high[i]! - v)).toString(16).padStart(2, "0")).join("")}`;
}
