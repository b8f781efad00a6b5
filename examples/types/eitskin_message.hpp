// Written by tables/make_tables.py from python/eitskin/session/message.schema.json.
// The messages of eitskin, version 1: docs/reference/message.md. C++17.
//
// from_json reads each structure from the JSON of nlohmann/json, or of a library with the same
// functions: `json.get<eitskin::Frame>()`. Members that a message may lack, or that may be null,
// are std::optional. Objects without a fixed form (`info`, `link`, ...) are left out: read them
// from the JSON.
#ifndef EITSKIN_MESSAGE_HPP
#define EITSKIN_MESSAGE_HPP

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace eitskin {
namespace detail {

template <class T> struct value {
    template <class Json> static void read(const Json &from, T &to) { from.get_to(to); }
};
template <class T> struct value<std::optional<T>> {
    template <class Json> static void read(const Json &from, std::optional<T> &to)
    {
        if (from.is_null()) {
            to.reset();
            return;
        }
        T read{};
        value<T>::read(from, read);
        to = std::move(read);
    }
};
template <class T> struct value<std::vector<T>> {
    template <class Json> static void read(const Json &from, std::vector<T> &to)
    {
        to.clear();
        for (const auto &one : from) {
            T read{};
            value<T>::read(one, read);
            to.push_back(std::move(read));
        }
    }
};
template <class Json, class T> void member(const Json &from, const char *name, T &to)
{
    const auto found = from.find(name);
    if (found != from.end())
        value<T>::read(*found, to);
}

} // namespace detail

struct Touch {
    // stays with a touch from frame to frame, the same as in reports
    std::int64_t id{};
    double x_mm{};
    double y_mm{};
    double radius_mm{};
    // conductivity change integrated over the touch, S mm^2/m
    double strength_s_per_m_mm2{};
    // fraction of |y|^2 that leaving it out would leave unexplained; 0 where it is held
    double explained{};
    // N; null where the model is not calibrated
    std::optional<double> force_n;
    std::optional<double> confidence;
    std::optional<double> x_variance_mm2;
    std::optional<double> xy_covariance_mm2;
    std::optional<double> y_variance_mm2;
    // half of the long axis, as a vector, of the ellipse that the touch is, of area pi radius_mm^2;
    // null: a disc, or not known
    std::optional<double> long_x_mm;
    std::optional<double> long_y_mm;
    // a whole frame has shown it; false: only drives have
    bool confirmed{};
    // from the true touch, where the truth is known; null: there is none
    std::optional<double> error_mm;
    // the centre in the frame of the link, where that is known
    std::optional<std::vector<double>> position_m;
    // unit vector out of the skin, in the frame of the link
    std::optional<std::vector<double>> normal;
    // of the frame of reference at the touch: x along the drawing's x, z along the normal
    std::optional<std::vector<double>> quaternion_xyzw;
    // true millimetres per millimetre of the drawing there; 1: a flat skin
    std::optional<double> scale;
    // of position_m
    std::optional<std::vector<std::vector<double>>> covariance_m2;
};
template <class Json> void from_json(const Json &from, Touch &to)
{
    detail::member(from, "id", to.id);
    detail::member(from, "x_mm", to.x_mm);
    detail::member(from, "y_mm", to.y_mm);
    detail::member(from, "radius_mm", to.radius_mm);
    detail::member(from, "strength_s_per_m_mm2", to.strength_s_per_m_mm2);
    detail::member(from, "explained", to.explained);
    detail::member(from, "force_n", to.force_n);
    detail::member(from, "confidence", to.confidence);
    detail::member(from, "x_variance_mm2", to.x_variance_mm2);
    detail::member(from, "xy_covariance_mm2", to.xy_covariance_mm2);
    detail::member(from, "y_variance_mm2", to.y_variance_mm2);
    detail::member(from, "long_x_mm", to.long_x_mm);
    detail::member(from, "long_y_mm", to.long_y_mm);
    detail::member(from, "confirmed", to.confirmed);
    detail::member(from, "error_mm", to.error_mm);
    detail::member(from, "position_m", to.position_m);
    detail::member(from, "normal", to.normal);
    detail::member(from, "quaternion_xyzw", to.quaternion_xyzw);
    detail::member(from, "scale", to.scale);
    detail::member(from, "covariance_m2", to.covariance_m2);
}

struct Gesture {
    std::string kind;
    std::optional<std::string> phase;
    std::vector<std::int64_t> touch_ids;
    std::optional<double> x_mm;
    std::optional<double> y_mm;
    std::optional<double> time_s;
    // of a swipe: 0 along x, 90 along y
    std::optional<double> direction_deg;
    // hold: s; swipe: mm; pinch, spread: distance over that at the beginning; rotate: degrees;
    // press in a ring: turn from x, 0 to 1
    std::optional<double> value;
    // the name of the zone that is pressed or released
    std::optional<std::string> zone;
};
template <class Json> void from_json(const Json &from, Gesture &to)
{
    detail::member(from, "kind", to.kind);
    detail::member(from, "phase", to.phase);
    detail::member(from, "touch_ids", to.touch_ids);
    detail::member(from, "x_mm", to.x_mm);
    detail::member(from, "y_mm", to.y_mm);
    detail::member(from, "time_s", to.time_s);
    detail::member(from, "direction_deg", to.direction_deg);
    detail::member(from, "value", to.value);
    detail::member(from, "zone", to.zone);
}

struct FramePlace {
    double x_mm{};
    double y_mm{};
    std::optional<double> error_mm;
};
template <class Json> void from_json(const Json &from, FramePlace &to)
{
    detail::member(from, "x_mm", to.x_mm);
    detail::member(from, "y_mm", to.y_mm);
    detail::member(from, "error_mm", to.error_mm);
}

struct TrueTouch {
    double x_mm{};
    double y_mm{};
    double radius_mm{};
    double contrast{};
};
template <class Json> void from_json(const Json &from, TrueTouch &to)
{
    detail::member(from, "x_mm", to.x_mm);
    detail::member(from, "y_mm", to.y_mm);
    detail::member(from, "radius_mm", to.radius_mm);
    detail::member(from, "contrast", to.contrast);
}

struct Frame {
    // name of the board, skin or source, else its serial number; null: of a file
    std::optional<std::string> source;
    std::int64_t version{};
    std::string type;
    std::optional<std::string> link;
    // the board's count, or the frame's place in its file
    std::int64_t frame{};
    // of a file's frame
    std::optional<std::string> name;
    // when its scan began, from the first frame of the stream; null where a file does not tell
    std::optional<double> time_s;
    // when it was complete on the host, seconds since 1970 UTC; null for what was recorded
    std::optional<double> time_unix_s;
    // the board's clock when its scan began; wraps at 2^32
    std::optional<std::int64_t> board_us;
    // strongest first; null where none were asked for
    std::optional<std::vector<Touch>> touches;
    std::vector<Gesture> events;
    // names, docs/reference/diagnostics.md
    std::vector<std::string> diagnostics;
    // the same in a few words each
    std::vector<std::string> found;
    // why the core refused the frame
    std::optional<std::string> refused;
    // the image that shows the frame, by the model's pixels
    std::optional<std::vector<double>> image_s_per_m;
    // what that image is: the touches drawn, or the solver's
    std::optional<std::string> image_is;
    std::optional<double> peak_s_per_m;
    std::optional<std::vector<double>> peak_mm;
    // centroids of what stands out of the solver's image, strongest first
    std::optional<std::vector<FramePlace>> places;
    // by the protocol's rows; null where a row cannot be used
    std::optional<std::vector<std::optional<double>>> voltage_v;
    std::optional<std::vector<std::int64_t>> quality;
    std::optional<std::int64_t> scan_us;
    // of a tare
    std::optional<bool> quiet;
    std::optional<std::vector<TrueTouch>> true_;
    std::optional<double> miou_image;
    std::optional<double> miou_solver;
    std::optional<double> miou_touches;
    std::optional<std::vector<double>> position_errors_mm;
};
template <class Json> void from_json(const Json &from, Frame &to)
{
    detail::member(from, "source", to.source);
    detail::member(from, "version", to.version);
    detail::member(from, "type", to.type);
    detail::member(from, "link", to.link);
    detail::member(from, "frame", to.frame);
    detail::member(from, "name", to.name);
    detail::member(from, "time_s", to.time_s);
    detail::member(from, "time_unix_s", to.time_unix_s);
    detail::member(from, "board_us", to.board_us);
    detail::member(from, "touches", to.touches);
    detail::member(from, "events", to.events);
    detail::member(from, "diagnostics", to.diagnostics);
    detail::member(from, "found", to.found);
    detail::member(from, "refused", to.refused);
    detail::member(from, "image_s_per_m", to.image_s_per_m);
    detail::member(from, "image_is", to.image_is);
    detail::member(from, "peak_s_per_m", to.peak_s_per_m);
    detail::member(from, "peak_mm", to.peak_mm);
    detail::member(from, "places", to.places);
    detail::member(from, "voltage_v", to.voltage_v);
    detail::member(from, "quality", to.quality);
    detail::member(from, "scan_us", to.scan_us);
    detail::member(from, "quiet", to.quiet);
    detail::member(from, "true", to.true_);
    detail::member(from, "miou_image", to.miou_image);
    detail::member(from, "miou_solver", to.miou_solver);
    detail::member(from, "miou_touches", to.miou_touches);
    detail::member(from, "position_errors_mm", to.position_errors_mm);
}

struct ReportTouche {
    // stays with a touch, the same as in frames
    std::int64_t id{};
    // a whole frame has shown it
    bool confirmed{};
    double x_mm{};
    double y_mm{};
    double vx_mm_per_s{};
    double vy_mm_per_s{};
    double strength_s_per_m_mm2{};
    double radius_mm{};
    double x_variance_mm2{};
    double xy_covariance_mm2{};
    double y_variance_mm2{};
    std::optional<std::vector<double>> position_m;
    std::optional<std::vector<double>> normal;
    std::optional<std::vector<double>> quaternion_xyzw;
    std::optional<std::vector<std::vector<double>>> covariance_m2;
    std::optional<double> scale;
    std::optional<std::vector<double>> velocity_m_per_s;
};
template <class Json> void from_json(const Json &from, ReportTouche &to)
{
    detail::member(from, "id", to.id);
    detail::member(from, "confirmed", to.confirmed);
    detail::member(from, "x_mm", to.x_mm);
    detail::member(from, "y_mm", to.y_mm);
    detail::member(from, "vx_mm_per_s", to.vx_mm_per_s);
    detail::member(from, "vy_mm_per_s", to.vy_mm_per_s);
    detail::member(from, "strength_s_per_m_mm2", to.strength_s_per_m_mm2);
    detail::member(from, "radius_mm", to.radius_mm);
    detail::member(from, "x_variance_mm2", to.x_variance_mm2);
    detail::member(from, "xy_covariance_mm2", to.xy_covariance_mm2);
    detail::member(from, "y_variance_mm2", to.y_variance_mm2);
    detail::member(from, "position_m", to.position_m);
    detail::member(from, "normal", to.normal);
    detail::member(from, "quaternion_xyzw", to.quaternion_xyzw);
    detail::member(from, "covariance_m2", to.covariance_m2);
    detail::member(from, "scale", to.scale);
    detail::member(from, "velocity_m_per_s", to.velocity_m_per_s);
}

struct Report {
    // name of the board, skin or source, else its serial number; null: of a file
    std::optional<std::string> source;
    std::int64_t version{};
    std::string type;
    std::optional<std::string> link;
    // that is being scanned
    std::int64_t frame{};
    // of the protocol; the touches are those after it
    std::int64_t drive{};
    // the instant that places and velocities hold for, by the clock of frames
    double time_s{};
    std::optional<double> time_unix_s;
    // the same by the board's clock
    std::int64_t board_us{};
    // on the board, from the drive's end until its packet was made
    std::int64_t age_us{};
    std::vector<ReportTouche> touches;
};
template <class Json> void from_json(const Json &from, Report &to)
{
    detail::member(from, "source", to.source);
    detail::member(from, "version", to.version);
    detail::member(from, "type", to.type);
    detail::member(from, "link", to.link);
    detail::member(from, "frame", to.frame);
    detail::member(from, "drive", to.drive);
    detail::member(from, "time_s", to.time_s);
    detail::member(from, "time_unix_s", to.time_unix_s);
    detail::member(from, "board_us", to.board_us);
    detail::member(from, "age_us", to.age_us);
    detail::member(from, "touches", to.touches);
}

struct Notice {
    // name of the board, skin or source, else its serial number; null: of a file
    std::optional<std::string> source;
    std::int64_t version{};
    std::string type;
    std::string kind;
    std::string text;
    std::optional<double> time_s;
    std::optional<double> time_unix_s;
};
template <class Json> void from_json(const Json &from, Notice &to)
{
    detail::member(from, "source", to.source);
    detail::member(from, "version", to.version);
    detail::member(from, "type", to.type);
    detail::member(from, "kind", to.kind);
    detail::member(from, "text", to.text);
    detail::member(from, "time_s", to.time_s);
    detail::member(from, "time_unix_s", to.time_unix_s);
}

struct SummarySummarySink {
    std::string url;
    std::int64_t sent{};
    std::int64_t dropped{};
    std::int64_t failed{};
    std::optional<std::string> error;
};
template <class Json> void from_json(const Json &from, SummarySummarySink &to)
{
    detail::member(from, "url", to.url);
    detail::member(from, "sent", to.sent);
    detail::member(from, "dropped", to.dropped);
    detail::member(from, "failed", to.failed);
    detail::member(from, "error", to.error);
}

struct SummarySummary {
    std::int64_t frames{};
    // after which touches were reported
    std::optional<std::int64_t> drives;
    std::int64_t refused{};
    std::int64_t faults{};
    std::optional<double> frames_a_second;
    std::optional<double> solve_us_p50;
    std::optional<double> solve_us_p99;
    std::optional<std::string> picture;
    std::optional<std::vector<SummarySummarySink>> sinks;
};
template <class Json> void from_json(const Json &from, SummarySummary &to)
{
    detail::member(from, "frames", to.frames);
    detail::member(from, "drives", to.drives);
    detail::member(from, "refused", to.refused);
    detail::member(from, "faults", to.faults);
    detail::member(from, "frames_a_second", to.frames_a_second);
    detail::member(from, "solve_us_p50", to.solve_us_p50);
    detail::member(from, "solve_us_p99", to.solve_us_p99);
    detail::member(from, "picture", to.picture);
    detail::member(from, "sinks", to.sinks);
}

struct Summary {
    // name of the board, skin or source, else its serial number; null: of a file
    std::optional<std::string> source;
    std::int64_t version{};
    std::string type;
    SummarySummary summary;
};
template <class Json> void from_json(const Json &from, Summary &to)
{
    detail::member(from, "source", to.source);
    detail::member(from, "version", to.version);
    detail::member(from, "type", to.type);
    detail::member(from, "summary", to.summary);
}

struct Reconstruction {
    std::int64_t version{};
    std::string type;
    std::string model;
    std::string engine;
    std::vector<Frame> frames;
};
template <class Json> void from_json(const Json &from, Reconstruction &to)
{
    detail::member(from, "version", to.version);
    detail::member(from, "type", to.type);
    detail::member(from, "model", to.model);
    detail::member(from, "engine", to.engine);
    detail::member(from, "frames", to.frames);
}

} // namespace eitskin

#endif
