// The server's JSON API and containers. Types mirror crates/server/src/openapi.json.

export type Point = [number, number, number];

export interface Rigid {
  quaternion_wxyz: [number, number, number, number];
  translation_mm: Point;
}

export interface Case {
  pseudonym: string;
  side: "left" | "right";
  notice: string;
  plan: { entry_lps_mm: Point; target_lps_mm: Point; length_mm: number };
  nodes: number;
  elements: number;
  has_ct: boolean;
  has_report: boolean;
}

export interface Guidance {
  phase: "no_case" | "case" | "calibrated" | "registered" | "checked" | "navigating";
  state: "live" | "stale" | "lost";
  age_ms: number | null;
  deformation_age_ms: number | null;
  distance_to_target_mm: number | null;
  distance_to_target_rigid_mm: number | null;
  entry_offset_mm: number | null;
  entry_angle_error_deg: number | null;
  depth_mm: number | null;
  miss_mm: number | null;
  in_ventricle: boolean | null;
  tip_in: string | null;
  csf_depth_mm: number | null;
  axial_force_mn: number | null;
  kakarla_grade: number | null;
  predicted_tre_mm: number | null;
  why_no_numbers: string | null;
  tip_lps_mm: Point | null;
  axis_lps: Point | null;
  eye_right_lps: Point | null;
  eye_up_lps: Point | null;
  target_lps_mm: Point | null;
  target_in_eye_mm: [number, number] | null;
  display_from_patient: Rigid | null;
  display_age_ms: number | null;
  target_shift_mm: number | null;
  largest_displacement_mm: number;
  drained_asked_ml: number | null;
  drained_ml: number;
  csf_pressure_change_mmhg: number;
  crushed_elements: number;
  tissue_doubt: string | null;
  solver_fault: boolean;
  solver_faults: number;
  reference_moved_mm: number | null;
  reference_turned_deg: number | null;
  time_s: number;
}

/** What can be drawn of the guidance. */
export type Seen = Pick<Guidance,
  "tip_lps_mm" | "axis_lps" | "eye_up_lps" | "target_lps_mm" | "target_in_eye_mm" | "predicted_tre_mm" | "display_from_patient" | "display_age_ms">;

/** Nothing is seen. */
export const NOTHING: Seen = {
  tip_lps_mm: null, axis_lps: null, eye_up_lps: null, target_lps_mm: null, target_in_eye_mm: null, predicted_tre_mm: null,
  display_from_patient: null, display_age_ms: null,
};

export type Role = "viewer" | "operator";

export interface Status {
  role: Role | null;
  tracker: string;
  tracker_diagnosis: string;
  tracker_trouble: string | null;
  recording_trouble: string | null;
  simulated: boolean;
  paused: boolean;
  tracking_hz: number;
  tracking_ms: number;
  snapshot_hz: number;
  snapshot_ms: number;
  deformation_hz: number;
  deformation_ms: number;
  displays: number;
}

export interface Tissue {
  mode: "physical" | "paper";
  skull: "held" | "slides";
  ventricles_ml: number;
  drain_ml: number | null;
  gravity_m_s2: Point;
}

export interface LandmarkState {
  name: string;
  marked_lps_mm: Point;
  added: boolean;
  touched: boolean;
  spread_mm: number | null;
  residual_mm: number | null;
  left_out_mm: number | null;
  expected_mm: number | null;
  outlier: boolean;
}

export interface Registration {
  landmarks: LandmarkState[];
  predicted_tre_mm: number | null;
  why_not: string | null;
  remarks: string[];
  phase: Guidance["phase"];
  checked: { name: string; distance_mm: number; limit_mm: number; holds: boolean; hidden_motion_mm: number | null } | null;
}

export interface Calibration {
  phase: Guidance["phase"];
  tip: { tip_mm: Point; tip_sigma_mm: number; residual_mm: number; tilt_deg: number; poses: number; used: number; remark: string | null } | null;
  axis: { axis: Point; wobble_deg: number; axis_sigma_deg: number } | null;
}

/** The server says why not. */
export class Refused extends Error {}

/** There is no such thing on this server (any more). */
export class NotFound extends Error {}

/** The token is missing or wrong. */
export class Unauthorized extends Error {}

/** A page that took longer to get its ticket, busy with its first picture on a slow machine, asks for another: they are good for 30 s. */
const TICKET_MS = 15_000;

export class Api {
  readonly #token: string;

  constructor(token: string) {
    this.#token = token;
  }

  async #fetch(path: string, method = "GET", body?: unknown): Promise<Response> {
    const headers = { Authorization: `Bearer ${this.#token}`, ...(body === undefined ? {} : { "Content-Type": "application/json" }) };
    const response = await fetch(path, { method, headers, ...(body === undefined ? {} : { body: JSON.stringify(body) }) });
    if (response.status === 401) throw new Unauthorized("The access token is missing or wrong.");
    if (response.status === 409 || response.status === 422) throw new Refused(((await response.json()) as { error: string }).error);
    if (response.status === 404) throw new NotFound(`${path}: ${await response.text()}`);
    if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
    return response;
  }

  async case(): Promise<Case> {
    return (await this.#fetch("/api/case")).json() as Promise<Case>;
  }

  async status(): Promise<Status> {
    return (await this.#fetch("/api/status")).json() as Promise<Status>;
  }

  async tissue(): Promise<Tissue> {
    return (await this.#fetch("/api/tissue")).json() as Promise<Tissue>;
  }

  /** Changes what is done to the fluid, or gravity; gives all that is done then. */
  async load(loads: object): Promise<Tissue> {
    return this.post("/api/tissue", loads);
  }

  async registration(): Promise<Registration> {
    return (await this.#fetch("/api/registration")).json() as Promise<Registration>;
  }

  /** Touches, forgets, marks, accepts or checks. */
  async register(action: string, more: { name?: string; position_lps_mm?: Point } = {}): Promise<Registration> {
    return this.post("/api/registration", { action, ...more });
  }

  async calibration(): Promise<Calibration> {
    return (await this.#fetch("/api/calibration")).json() as Promise<Calibration>;
  }

  /** Watches a motion of the catheter for so many seconds, or accepts what was found. */
  async calibrate(action: "pivot" | "turn" | "accept", seconds?: number): Promise<Calibration> {
    return this.post("/api/calibration", seconds === undefined ? { action } : { action, seconds });
  }

  /** An event of the procedure. */
  async event(event: string): Promise<void> {
    await this.post("/api/session", { event });
  }

  /** A code by which another device comes in, and for how long it is good. */
  async invite(role: Role): Promise<{ code: string; seconds: number }> {
    return this.post("/api/pairing", { role });
  }

  async container(path: "/api/scene" | "/api/ct"): Promise<Container> {
    return new Container(await (await this.#fetch(path)).arrayBuffer());
  }

  async json<T>(path: string, method = "GET"): Promise<T> {
    return (await this.#fetch(path, method)).json() as Promise<T>;
  }

  async post<T>(path: string, body: object): Promise<T> {
    return (await this.#fetch(path, "POST", body)).json() as Promise<T>;
  }

  async bytes(path: string): Promise<ArrayBuffer> {
    return (await this.#fetch(path)).arrayBuffer();
  }

  /** A one-time ticket for a WebSocket or a link: browsers cannot set headers there. */
  async ticket(): Promise<string> {
    const { ticket } = (await (await this.#fetch("/api/ticket", "POST")).json()) as { ticket: string };
    return ticket;
  }

  /** A WebSocket that a ticket lets in. */
  async socket(path: "/live" | "/desk"): Promise<WebSocket> {
    const url = new URL(path, location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    url.hash = "";
    let asked: number;
    do {
      asked = performance.now();
      url.searchParams.set("ticket", await this.ticket());
    } while (performance.now() - asked > TICKET_MS);
    return new WebSocket(url);
  }
}

/** `MNRB`: JSON, then arrays (crates/server/src/container.rs). */
export class Container {
  readonly header: unknown;
  readonly #buffer: ArrayBuffer;
  readonly #start: number;

  constructor(buffer: ArrayBuffer) {
    const view = new DataView(buffer);
    const length = view.getUint32(4, true);
    if (view.getUint32(0, false) !== 0x4d4e5242) throw new Error("The server sent no MNRB container.");
    this.#start = 8 + length;
    this.#buffer = buffer;
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  }

  floats(at: number, count: number): Float32Array<ArrayBuffer> {
    return new Float32Array(this.#buffer, this.#start + at, count);
  }

  words(at: number, count: number): Uint32Array<ArrayBuffer> {
    return new Uint32Array(this.#buffer, this.#start + at, count);
  }

  halves(at: number, count: number): Uint16Array<ArrayBuffer> {
    return new Uint16Array(this.#buffer, this.#start + at, count);
  }
}
