/** Types of the vendored `htm/preact/standalone.module.js`: what of Preact and htm the dashboard uses. */

export interface VNode {
  type: unknown;
  props: Record<string, unknown>;
  key: unknown;
}

/** What a component may return and an element may hold. */
export type Child = VNode | string | number | bigint | boolean | null | undefined | readonly Child[];

export interface Ref<T> {
  current: T;
}

type Update<S> = S | ((before: S) => S);
type Cleanup = () => void;
type Inputs = readonly unknown[];

/** Attributes and children of a template are not checked: htm parses it at run time. */
export function html(strings: TemplateStringsArray, ...values: unknown[]): VNode;
export function h(type: unknown, props: Record<string, unknown> | null, ...children: unknown[]): VNode;
export function render(node: Child, parent: Element): void;

export function useState<S>(initial: S | (() => S)): [S, (next: Update<S>) => void];
export function useReducer<S, A>(reducer: (state: S, action: A) => S, initial: S): [S, (action: A) => void];
export function useEffect(effect: () => void | Cleanup, inputs?: Inputs): void;
export function useLayoutEffect(effect: () => void | Cleanup, inputs?: Inputs): void;
export function useRef<T>(initial: T): Ref<T>;
export function useRef<T>(initial: null): Ref<T | null>;
export function useMemo<T>(make: () => T, inputs: Inputs): T;
export function useCallback<F extends (...args: never[]) => unknown>(callback: F, inputs: Inputs): F;
export function useContext<T>(context: Context<T>): T;
export function useErrorBoundary(onError?: (error: unknown) => void): [unknown, () => void];

export interface Context<T> {
  Provider: (props: { value: T; children?: Child }) => VNode;
}
export function createContext<T>(value: T): Context<T>;

export class Component<P = Record<string, unknown>, S = Record<string, unknown>> {
  constructor(props?: P);
  props: P & { children?: Child };
  state: S;
  setState(next: Partial<S> | ((before: S, props: P) => Partial<S>), after?: () => void): void;
  forceUpdate(after?: () => void): void;
  componentDidMount?(): void;
  componentDidUpdate?(before: P, state: S): void;
  componentWillUnmount?(): void;
  componentDidCatch?(error: unknown): void;
  shouldComponentUpdate?(next: P, state: S): boolean;
  render(props?: P, state?: S): Child;
}
