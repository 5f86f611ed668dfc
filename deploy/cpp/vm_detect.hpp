// Reads the messages of vm-detect from its Unix socket, in the binary form that docs/daemon.md describes.
//
//     vm_detect::Client detector("/run/vm-detect/lines.sock");
//     while (running) {
//         detector.update();  // never blocks
//         if (const vm_detect::Frame* frame = detector.frame(0.25)) {
//             for (const vm_detect::Detection& ball : frame->detections) { ... }
//         } else {
//             stand(detector.state(), detector.reason());
//         }
//     }
//
// docs/help_pages.py makes the parts between a line `messages` and a line `end`.
// It needs C++17 and Linux, no library. Units: meters, seconds, radians, pixels. Frames: as in docs/use.md.
// vm-detect must send the binary form: [output] unix = "/run/vm-detect/lines.sock", unix_format = "binary".
#ifndef VM_DETECT_HPP
#define VM_DETECT_HPP

#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "vm_detect.hpp reads little-endian numbers; this processor is big-endian"
#endif

namespace vm_detect {

// The state of vm-detect, as docs/daemon.md lists them. unreachable: there is no connection, or it is silent.
// messages: states
enum class State : std::uint8_t { starting, ok, degraded, camera_lost, pose_stale, stopping, unreachable };

inline const char* name(State state) {
    static constexpr std::array<const char*, 7> names{
        "starting", "ok", "degraded", "camera_lost", "pose_stale", "stopping", "unreachable"};
    return names[static_cast<std::size_t>(state)];
}
// end

using Pair = std::array<float, 2>;
using Triple = std::array<float, 3>;

// messages: structures
// Time of each stage and of the whole call [ms]; NaN for a stage that was not needed.
struct Times {
    float mesh = 0.0F, project = 0.0F, sample = 0.0F, infer = 0.0F, propose = 0.0F, look = 0.0F, cluster =
        0.0F, field = 0.0F, track = 0.0F, total = 0.0F;
};

// One object over several frames, at the time of its last detection. The frame is that of Detection.
struct Track {
    // its number, from 1; a Tracker uses each number once
    std::uint32_t id{};
    // of its center, smoothed [m]
    Triple position{};
    // on the plane [m/s]
    Pair velocity{};
    // standard deviation of the position in the direction in which it is largest [m]
    float position_error{};
    // standard deviation of the velocity in the direction in which it is largest [m/s]
    float velocity_error{};
};

// One object on the observation plane, or, with a `reason`, a rejected candidate.
struct Detection {
    // name of its class
    std::string class_name{};
    // 0 to 1; with a close look its calibrated probability, otherwise the mean probability of the points inside
    // its outline
    float confidence{};
    // centroid of its outline [px]
    Pair center{};
    // of a disk with the same area as its outline [px]
    float radius{};
    // unit vector from the camera to its center
    Triple bearing{};
    // its center: where the bearing meets the plane that is parallel to the observation plane, at the height of
    // the object's center [m]
    Triple position{};
    // from the camera to this center [m]
    float distance{};
    // angle from its center to its outline. With a close look, it follows from the size that the close look saw;
    // without one, from the size that fits the points best [rad]
    float angular_radius{};
    // distance that follows from `angular_radius` and the real radius [m]
    float distance_by_angle{};
    // whether the apparent size is near the size expected at `distance`, within 20 % with a close look, otherwise
    // within one ring spacing of the mesh
    bool distances_agree{};
    // number of mesh points inside its outline
    std::uint32_t points{};
    // the object over several frames, if a Tracker follows it
    std::optional<Track> track{};
};

// Something that stands on the plane: a goal post, or a robot or another obstacle.
struct Upright {
    // post or robot
    std::string class_name{};
    // calibrated probability of a close look; if the class has none, the probability of a peak; if it has no
    // peaks either, the mean probability of its points; 0 to 1
    float confidence{};
    // its base, which is the middle of a post's foot, or the front of a robot's foot, in the direction of its
    // middle [m]
    Pair position{};
    // from the camera to the base [m]
    float distance{};
    // unit vector from the camera to the base
    Triple bearing{};
    // of the base; NaN outside of the picture [px]
    Pair pixel{};
    // as seen from the camera [m]
    float width{};
};

// A straight piece of a field line: its middle line.
struct Segment {
    // both ends on the plane [m]
    std::array<Pair, 2> ends{};
    // of the ends; NaN outside of the picture [px]
    std::array<Pair, 2> pixels{};
    // mean probability of its points, 0 to 1
    float confidence{};
};

// The center circle.
struct CenterCircle {
    // on the plane [m]
    Pair center{};
    // of the middle of its line [m]
    float radius{};
    // how much of it is seen [rad]
    float arc{};
    // mean probability of its points, 0 to 1
    float confidence{};
};

// Where two field lines meet at a right angle.
struct Crossing {
    // its form
    char kind{};
    // on the plane [m]
    Pair position{};
    // counterclockwise from the x axis; for T the direction of the line that ends there, away from the crossing;
    // for L halfway between its two lines, into the corner; for X the direction of either line, from 0 to a right
    // angle [rad]
    float heading{};
    // product of those of its two lines, and down to half of it if one ends in front of the crossing; 0 to 1
    float confidence{};
};

// The visible border of the field: a convex polyline from right to left; if parts of it are hidden or too
// far, the longest part.
struct Border {
    // on the plane [m]
    std::vector<Pair> points{};
    // of the points [px]
    std::vector<Pair> pixels{};
};

// All that a frame shows of the field; empty where the network has no class for it.
struct FieldFeatures {
    // goal posts, nearest first
    std::vector<Upright> posts{};
    // pairs of indices in `posts`, from 0; the left post of each goal first, as seen from the camera
    std::vector<std::array<std::uint32_t, 2>> goals{};
    // robots and other obstacles, nearest first
    std::vector<Upright> robots{};
    // straight pieces of the field lines, longest first; a line may have several
    std::vector<Segment> lines{};
    // the center circle, if the picture shows it
    std::optional<CenterCircle> circle{};
    // where two lines meet at a right angle
    std::vector<Crossing> crossings{};
    // the visible border, if the picture shows it
    std::optional<Border> border{};
};

// What the frames so far say about the camera's pose.
struct PoseState {
    // wrong, doubtful or consistent; unknown if the frames show too little
    char verdict{};
    // error of the pitch: true minus assumed one; null if unknown [deg]
    float pitch{};
    // error of the roll: true minus assumed one; null if unknown [deg]
    float roll{};
    // how much larger the true height is; null if unknown [%]
    float height{};
    // number of different pictures
    std::uint32_t frames{};
    // number of balls that it rests on
    std::uint32_t balls{};
    // number of pieces of lines that it rests on
    std::uint32_t lines{};
    // correction that is added to the pitch; only with [pose] correct [deg]
    float added_pitch{};
    // correction that is added to the roll [deg]
    float added_roll{};
    // correction of the height [%]
    float added_height{};
};

// A frame of a live camera.
struct Frame {
    // number of the frame, from 1
    std::uint32_t frame{};
    // time of capture on the monotonic clock [s]
    double t{};
    // time of capture since 1970 [s]
    double wall{};
    // time from capture to the message [ms]
    float age_ms{};
    // time from the frame's arrival to the message [ms]
    float latency_ms{};
    // number of mesh points on screen
    std::uint32_t points{};
    // the objects, most confident first
    std::vector<Detection> detections{};
    // features of the field; only with a network that knows them
    std::optional<FieldFeatures> field{};
    // what the frames so far say about the camera's pose; null if it is not checked
    std::optional<PoseState> pose{};
    // time of each stage and of the whole call [ms]
    Times timing_ms{};
};
// end

// One message: a state with its reason, or a frame in a state.
struct Message {
    State state = State::starting;
    double t = 0.0, wall = 0.0;
    std::string reason;
    std::optional<Frame> frame;
};

// Bytes that are not the binary form.
struct ProtocolError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

constexpr std::size_t most_bytes = std::size_t{4} << 20;  // a frame full of lines takes a few kilobytes

namespace detail {

// Takes numbers from the front of a part of a message. names: the classes of the frame. Throws ProtocolError at its end.
class Cursor {
  public:
    Cursor(const std::uint8_t* data, std::size_t size, const std::vector<std::string>& names = {})
        : data_(data), end_(data + size), names_(names) {}

    template <typename Number>
    Number take() {
        static_assert(std::is_trivially_copyable_v<Number>);
        if (left() < sizeof(Number)) throw ProtocolError("a message's length does not fit its records");
        Number value;
        std::memcpy(&value, data_, sizeof(Number));
        data_ += sizeof(Number);
        return value;
    }

    const std::string& class_name() {
        const auto number = take<std::uint32_t>();
        if (number >= names_.size()) throw ProtocolError("a record has a class without a name");
        return names_[number];
    }

    char choice(const std::string& letters) {
        const auto number = take<std::uint32_t>();
        if (number >= letters.size()) throw ProtocolError("a record has an unknown letter");
        return letters[number];
    }

    std::size_t left() const { return static_cast<std::size_t>(end_ - data_); }

  private:
    const std::uint8_t* data_;
    const std::uint8_t* end_;
    std::vector<std::string> names_;
};

template <typename Number>
void read(Cursor& from, Number& made) {
    made = from.take<Number>();
}

inline void read(Cursor& from, bool& made) { made = from.take<std::uint32_t>() != 0; }

inline void read(Cursor& from, std::string& made) { made = from.class_name(); }

template <typename Item>
void read_list(Cursor& head, Cursor& body, std::vector<Item>& made) {
    for (auto count = head.take<std::uint32_t>(); count > 0; --count) read(body, made.emplace_back());
}

template <typename Item>
void read_list(Cursor& head, Cursor& body, std::optional<Item>& made) {
    for (auto count = head.take<std::uint32_t>(); count > 0; --count) read(body, made ? *made : made.emplace());
}

// messages: readers
constexpr std::uint32_t layout_number = 4388516U;
constexpr std::size_t header_bytes = 132;

inline void read(Cursor& from, Track& made) {
    read(from, made.id);
    read(from, made.position);
    read(from, made.velocity);
    read(from, made.position_error);
    read(from, made.velocity_error);
}

inline void read(Cursor& from, Detection& made) {
    read(from, made.class_name);
    read(from, made.confidence);
    read(from, made.center);
    read(from, made.radius);
    read(from, made.bearing);
    read(from, made.position);
    read(from, made.distance);
    read(from, made.angular_radius);
    read(from, made.distance_by_angle);
    read(from, made.distances_agree);
    read(from, made.points);
    read(from, made.track.emplace());
    if (made.track->id == 0) made.track.reset();
}

inline void read(Cursor& from, Upright& made) {
    read(from, made.class_name);
    read(from, made.confidence);
    read(from, made.position);
    read(from, made.distance);
    read(from, made.bearing);
    read(from, made.pixel);
    read(from, made.width);
}

inline void read(Cursor& from, Segment& made) {
    read(from, made.ends);
    read(from, made.pixels);
    read(from, made.confidence);
}

inline void read(Cursor& from, CenterCircle& made) {
    read(from, made.center);
    read(from, made.radius);
    read(from, made.arc);
    read(from, made.confidence);
}

inline void read(Cursor& from, Crossing& made) {
    made.kind = from.choice("LTX");
    read(from, made.position);
    read(from, made.heading);
    read(from, made.confidence);
}

inline void read(Cursor& from, Border& made) {
    read(from, made.points.emplace_back());
    read(from, made.pixels.emplace_back());
}

inline void read(Cursor& from, PoseState& made) {
    made.verdict = from.choice("unknownconsistentdoubtfulwrong");
    read(from, made.pitch);
    read(from, made.roll);
    read(from, made.height);
    read(from, made.frames);
    read(from, made.balls);
    read(from, made.lines);
    read(from, made.added_pitch);
    read(from, made.added_roll);
    read(from, made.added_height);
}

inline void read(Cursor& head, Cursor& body, Frame& made) {
    read(head, made.frame);
    read(head, made.t);
    read(head, made.wall);
    read(head, made.age_ms);
    read(head, made.latency_ms);
    read(head, made.points);
    read_list(head, body, made.detections);
    const bool has_field = head.take<std::uint32_t>() != 0;
    auto& field = made.field.emplace();
    read_list(head, body, field.posts);
    read_list(head, body, field.goals);
    read_list(head, body, field.robots);
    read_list(head, body, field.lines);
    read_list(head, body, field.circle);
    read_list(head, body, field.crossings);
    read_list(head, body, field.border);
    if (!has_field) made.field.reset();
    read_list(head, body, made.pose);
    read(head, made.timing_ms);
}
// end

inline std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find('\n', start), text.size());
        lines.push_back(text.substr(start, end - start));
        start = end + 1;
    }
    return lines;
}

}  // namespace detail

// Bytes of the message that begins here, or 0 if fewer than four bytes are there. Throws ProtocolError.
inline std::size_t message_bytes(const std::uint8_t* data, std::size_t size) {
    if (size > 0 && data[0] == '{')
        throw ProtocolError("the socket sends lines of JSON; set [output] unix_format = \"binary\"");
    if (size < 4) return 0;
    const std::size_t length = std::size_t{4} + detail::Cursor(data, size).take<std::uint32_t>();
    if (length < detail::header_bytes || length > most_bytes)
        throw ProtocolError("a message of " + std::to_string(length) + " bytes; is this vm-detect?");
    return length;
}

// A whole message, with its first four bytes. Throws ProtocolError.
inline Message decode(const std::uint8_t* data, std::size_t size) {
    using detail::header_bytes;
    if (size < header_bytes || message_bytes(data, size) != size) throw ProtocolError("a message was cut off");
    detail::Cursor head(data + 4, header_bytes - 4);
    const auto layout = head.take<std::uint32_t>();
    if (layout != detail::layout_number)
        throw ProtocolError("layout " + std::to_string(layout) + " of the binary form, but vm_detect.hpp reads layout " +
                            std::to_string(detail::layout_number) + "; use the header of the installed vm-detect");
    const auto is_frame = head.take<std::uint32_t>(), state = head.take<std::uint32_t>();
    if (is_frame > 1 || state >= static_cast<std::uint32_t>(State::unreachable)) throw ProtocolError("an unknown message");
    const std::size_t text_bytes = detail::Cursor(data + header_bytes - 4, 4).take<std::uint32_t>();
    if (text_bytes > size - header_bytes) throw ProtocolError("a message's length does not fit its text");
    std::string text(reinterpret_cast<const char*>(data) + (size - text_bytes), text_bytes);
    Message made;
    made.state = static_cast<State>(state);
    detail::Cursor body(data + header_bytes, size - header_bytes - text_bytes, detail::lines_of(text));
    Frame frame;
    detail::read(head, body, frame);
    if (body.left() != 0) throw ProtocolError("a message's length does not fit its records");
    made.t = frame.t;
    made.wall = frame.wall;
    if (is_frame == 0) {
        made.reason = std::move(text);
        return made;
    }
    if (frame.field)
        for (const auto& goal : frame.field->goals)
            if (std::max(goal[0], goal[1]) >= frame.field->posts.size())
                throw ProtocolError("a goal has a post that is not there");
    made.frame = std::move(frame);
    return made;
}

// Seconds on the clock of Frame::t.
inline double now() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// A connection to vm-detect. It connects again by itself, and no call ever blocks. Use it from one thread.
class Client {
  public:
    // Throws std::invalid_argument if the path is too long for a socket. vm-detect need not run yet.
    explicit Client(std::string path) : path_(std::move(path)) {
        if (path_.empty() || path_.size() >= sizeof(sockaddr_un::sun_path))
            throw std::invalid_argument("the path of a socket must have 1 to 107 bytes: " + path_);
    }

    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;
    ~Client() { disconnect("", 0.0); }

    // Read what has arrived, and connect if there is no connection. Call it in each pass of the behavior loop.
    // Returns whether a new frame has arrived.
    bool update() {
        fresh_ = false;
        try {
            if (socket_ < 0) connect();
            if (socket_ >= 0) receive();
        } catch (const ProtocolError& error) {
            disconnect(error.what(), now() + retry_s);
        }
        return fresh_;
    }

    // The state of the last message; unreachable without a connection, or if the last message is older than 2.5 s.
    // vm-detect sends at least one message per second.
    State state() const { return socket_ >= 0 && heard_ >= 0.0 && !silent() ? state_ : State::unreachable; }

    // Why it is in this state; it may be empty.
    std::string reason() const {
        if (socket_ < 0) return trouble_;
        if (heard_ < 0.0) return "waiting for the first message";
        if (silent()) return "vm-detect is silent";
        return reason_;
    }

    // The newest frame, or nullptr if it was captured longer than max_age [s] ago. Valid until the next update().
    const Frame* frame(double max_age) const {
        return frame_ && now() - frame_->t <= max_age ? &*frame_ : nullptr;
    }

  private:
    static constexpr double retry_s = 0.2, silence_s = 2.5;
    static constexpr int most_reads = 16;  // in one update: a flood of messages can't hold the loop

    bool silent() const { return now() - heard_ > silence_s; }

    void connect() {
        if (now() < retry_at_) return;
        socket_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::memcpy(address.sun_path, path_.c_str(), path_.size());
        if (socket_ < 0 || ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0)
            disconnect("can't connect to " + path_ + ": " + std::strerror(errno), now() + retry_s);
    }

    void receive() {
        std::array<std::uint8_t, 65536> piece;
        for (int read = 0; read < most_reads; ++read) {
            const ssize_t count = ::recv(socket_, piece.data(), piece.size(), 0);
            if (count < 0 && errno == EINTR) continue;
            if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
            if (count <= 0) return disconnect("vm-detect has closed the connection", now() + retry_s);
            buffer_.insert(buffer_.end(), piece.begin(), piece.begin() + count);
            take_messages();
        }
    }

    void take_messages() {
        std::size_t start = 0;
        while (start < buffer_.size()) {
            const std::size_t length = message_bytes(buffer_.data() + start, buffer_.size() - start);
            if (length == 0 || length > buffer_.size() - start) break;
            Message message = decode(buffer_.data() + start, length);
            start += length;
            heard_ = now();
            state_ = message.state;
            reason_ = std::move(message.reason);
            if (message.frame) {
                frame_ = std::move(message.frame);
                fresh_ = true;
            }
        }
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(start));
    }

    void disconnect(std::string trouble, double retry_at) {
        if (socket_ >= 0) ::close(socket_);
        socket_ = -1;
        heard_ = -1.0;
        retry_at_ = retry_at;
        buffer_.clear();
        trouble_ = std::move(trouble);
    }

    std::string path_, reason_, trouble_ = "not connected yet";
    int socket_ = -1;
    bool fresh_ = false;
    double heard_ = -1.0;  // when the last message came; -1: none on this connection
    double retry_at_ = 0.0;
    State state_ = State::starting;
    std::optional<Frame> frame_;
    std::vector<std::uint8_t> buffer_;
};

}  // namespace vm_detect

#endif
