/**
 * Types of the vendored Plotly bundle, as far as the plots use it. Loaded by a script tag, so it is a global;
 * the bundle puts itself at `Plotly`.
 */

declare namespace Plotly {
  type Axis = Record<string, unknown>;

  interface Data {
    type?: "scatter" | "scattergl" | "bar" | "pie";
    mode?: string;
    name?: string;
    x?: readonly (number | string | null)[];
    y?: readonly (number | string | null)[];
    text?: string | readonly string[];
    customdata?: readonly unknown[];
    hovertemplate?: string | readonly string[];
    hoverinfo?: string;
    legendgroup?: string;
    showlegend?: boolean;
    visible?: boolean | "legendonly";
    fill?: string;
    fillcolor?: string;
    opacity?: number;
    line?: Record<string, unknown>;
    marker?: Record<string, unknown>;
    error_x?: Record<string, unknown>;
    error_y?: Record<string, unknown>;
    xaxis?: string;
    yaxis?: string;
    [more: string]: unknown;
  }

  interface Layout {
    [more: string]: unknown;
  }

  interface Config {
    [more: string]: unknown;
  }

  interface EventPoint {
    x: number;
    y: number;
    customdata: any;
    curveNumber: number;
    pointNumber: number;
    data: Data;
  }

  interface Figure extends HTMLElement {
    data: Data[];
    layout: Layout;
    on(name: string, handler: (event: any) => void): void;
    removeAllListeners(name?: string): void;
  }

  interface Static {
    newPlot(parent: HTMLElement, data: readonly Data[], layout?: Layout, config?: Config): Promise<Figure>;
    react(parent: HTMLElement, data: readonly Data[], layout?: Layout, config?: Config): Promise<Figure>;
    relayout(parent: HTMLElement, layout: Layout): Promise<Figure>;
    restyle(parent: HTMLElement, data: Record<string, unknown>, indices?: readonly number[]): Promise<Figure>;
    purge(parent: HTMLElement): void;
    toImage(parent: HTMLElement, options?: Record<string, unknown>): Promise<string>;
    downloadImage(parent: HTMLElement, options?: Record<string, unknown>): Promise<string>;
    Plots: { resize(parent: HTMLElement): void };
  }
}

interface Window {
  /** Undefined until the script has loaded. */
  Plotly?: Plotly.Static;
}
