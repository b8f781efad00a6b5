// Written by tables/make_tables.py from python/eitskin/session/message.schema.json.
// The messages of eitskin, version 1: docs/reference/message.md.

export interface Touch {
  /** stays with a touch from frame to frame, the same as in reports */
  id: number;
  x_mm: number;
  y_mm: number;
  radius_mm: number;
  /** conductivity change integrated over the touch, S mm^2/m */
  strength_s_per_m_mm2: number;
  /** fraction of |y|^2 that leaving it out would leave unexplained; 0 where it is held */
  explained: number;
  /** N; null where the model is not calibrated */
  force_n: number | null;
  confidence: number | null;
  x_variance_mm2: number | null;
  xy_covariance_mm2: number | null;
  y_variance_mm2: number | null;
  /** half of the long axis, as a vector, of the ellipse that the touch is, of area pi radius_mm^2;
   *  null: a disc, or not known */
  long_x_mm: number | null;
  long_y_mm: number | null;
  /** a whole frame has shown it; false: only drives have */
  confirmed: boolean;
  /** from the true touch, where the truth is known; null: there is none */
  error_mm?: number | null;
  /** the centre in the frame of the link, where that is known */
  position_m?: number[];
  /** unit vector out of the skin, in the frame of the link */
  normal?: number[];
  /** of the frame of reference at the touch: x along the drawing's x, z along the normal */
  quaternion_xyzw?: number[];
  /** true millimetres per millimetre of the drawing there; 1: a flat skin */
  scale?: number;
  /** of position_m */
  covariance_m2?: number[][] | null;
}

export interface Gesture {
  kind: "down" | "move" | "up" | "tap" | "double-tap" | "hold" | "swipe" | "pinch" | "spread" | "rotate" | "press" | "release";
  phase?: "once" | "begin" | "change" | "end";
  touch_ids: number[];
  x_mm: number | null;
  y_mm: number | null;
  time_s: number | null;
  /** of a swipe: 0 along x, 90 along y */
  direction_deg?: number | null;
  /** hold: s; swipe: mm; pinch, spread: distance over that at the beginning; rotate: degrees; press
   *  in a ring: turn from x, 0 to 1 */
  value?: number | null;
  /** the name of the zone that is pressed or released */
  zone?: string | null;
}

export interface FramePlace {
  x_mm: number;
  y_mm: number;
  error_mm?: number | null;
}

export interface TrueTouch {
  x_mm: number;
  y_mm: number;
  radius_mm: number;
  contrast: number;
}

export interface Frame {
  /** name of the board, skin or source, else its serial number; null: of a file */
  source?: string | null;
  version: 1;
  type: "frame";
  link?: string | null;
  /** the board's count, or the frame's place in its file */
  frame: number;
  /** of a file's frame */
  name?: string;
  /** when its scan began, from the first frame of the stream; null where a file does not tell */
  time_s: number | null;
  /** when it was complete on the host, seconds since 1970 UTC; null for what was recorded */
  time_unix_s: number | null;
  /** the board's clock when its scan began; wraps at 2^32 */
  board_us?: number;
  /** strongest first; null where none were asked for */
  touches: Touch[] | null;
  events: Gesture[];
  /** names, docs/reference/diagnostics.md */
  diagnostics: string[];
  /** the same in a few words each */
  found: string[];
  /** why the core refused the frame */
  refused: string | null;
  /** what the solve cost and how it ended */
  info: Record<string, unknown> | null;
  /** the image that shows the frame, by the model's pixels */
  image_s_per_m?: number[];
  /** what that image is: the touches drawn, or the solver's */
  image_is?: "touches" | "solver";
  peak_s_per_m?: number | null;
  peak_mm?: number[] | null;
  /** centroids of what stands out of the solver's image, strongest first */
  places?: FramePlace[] | null;
  /** by the protocol's rows; null where a row cannot be used */
  voltage_v?: (number | null)[];
  quality?: number[];
  scan_us?: number;
  /** of a tare */
  quiet?: boolean;
  true?: TrueTouch[];
  miou_image?: number | null;
  miou_solver?: number | null;
  miou_touches?: number | null;
  position_errors_mm?: number[];
}

export interface ReportTouche {
  /** stays with a touch, the same as in frames */
  id: number;
  /** a whole frame has shown it */
  confirmed: boolean;
  x_mm: number;
  y_mm: number;
  vx_mm_per_s: number;
  vy_mm_per_s: number;
  strength_s_per_m_mm2: number;
  radius_mm: number;
  x_variance_mm2: number;
  xy_covariance_mm2: number;
  y_variance_mm2: number;
  position_m?: number[];
  normal?: number[];
  quaternion_xyzw?: number[];
  covariance_m2?: number[][] | null;
  scale?: number;
  velocity_m_per_s?: number[];
}

export interface Report {
  /** name of the board, skin or source, else its serial number; null: of a file */
  source?: string | null;
  version: 1;
  type: "report";
  link?: string | null;
  /** that is being scanned */
  frame: number;
  /** of the protocol; the touches are those after it */
  drive: number;
  /** the instant that places and velocities hold for, by the clock of frames */
  time_s: number;
  time_unix_s: number | null;
  /** the same by the board's clock */
  board_us: number;
  /** on the board, from the drive's end until its packet was made */
  age_us: number;
  touches: ReportTouche[];
}

export interface Notice {
  /** name of the board, skin or source, else its serial number; null: of a file */
  source?: string | null;
  version: 1;
  type: "notice";
  kind: "fault" | "link" | "diagnostic";
  text: string;
  time_s: number | null;
  time_unix_s: number | null;
}

export interface SummarySummarySink {
  url: string;
  sent: number;
  dropped: number;
  failed: number;
  error: string | null;
}

export interface SummarySummary {
  frames: number;
  /** after which touches were reported */
  drives?: number;
  refused: number;
  faults: number;
  frames_a_second: number | null;
  solve_us_p50: number | null;
  solve_us_p99: number | null;
  link: Record<string, unknown>;
  board: Record<string, unknown> | null;
  truth: Record<string, unknown> | null;
  /** of a robot: of each skin the same facts, by its name */
  skins?: Record<string, unknown>;
  picture?: string;
  sinks?: SummarySummarySink[];
}

export interface Summary {
  /** name of the board, skin or source, else its serial number; null: of a file */
  source?: string | null;
  version: 1;
  type: "summary";
  summary: SummarySummary;
}

export interface Reconstruction {
  version: 1;
  type: "reconstruction";
  model: string;
  engine: string;
  frames: Frame[];
  settings?: Record<string, unknown>;
  summary?: Record<string, unknown>;
}

export type Message = Frame | Report | Notice | Summary | Reconstruction;
