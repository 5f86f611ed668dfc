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
#include <utility>
#include <vector>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "vm_detect.hpp reads little-endian numbers; this processor is big-endian"
#endif

namespace vm_detect {

// The state of vm-detect, as docs/daemon.md lists them. unreachable: there is no connection, or it is silent.
enum class State : std::uint8_t { starting, ok, degraded, camera_lost, pose_stale, stopping, unreachable };

inline const char* name(State state) {
    static constexpr std::array<const char*, 7> names{"starting",   "ok",       "degraded",   "camera_lost",
                                                      "pose_stale", "stopping", "unreachable"};
    return names[static_cast<std::size_t>(state)];
}

using Pair = std::array<float, 2>;
using Triple = std::array<float, 3>;

// One object over several frames; only with [track] on = true. The errors are standard deviations.
struct Track {
    std::uint32_t id = 0;
    Triple position{};  // [m] smoothed
    Pair velocity{};    // [m/s]
    float position_error = 0.0F, velocity_error = 0.0F;
};

struct Detection {
    std::string class_name;
    float confidence = 0.0F;
    Triple position{};      // [m] its center, in the plane's frame
    float distance = 0.0F;  // [m] from the camera
    Triple bearing{};
    Pair center{};        // [px]
    float radius = 0.0F;  // [px]
    float angular_radius = 0.0F;
    float distance_by_angle = 0.0F;
    bool distances_agree = false;
    std::uint32_t points = 0;
    std::optional<Track> track;
};

// A goal post or a robot. Pixels outside of the picture are NaN.
struct Upright {
    std::string class_name;
    float confidence = 0.0F;
    Pair position{};
    float distance = 0.0F;
    Triple bearing{};
    Pair pixel{};
    float width = 0.0F;
};

struct Goal {
    std::uint32_t left = 0, right = 0;  // indices in Field::posts
};

struct Segment {
    std::array<Pair, 2> ends{}, pixels{};
    float confidence = 0.0F;
};

struct Circle {
    Pair center{};
    float radius = 0.0F, arc = 0.0F, confidence = 0.0F;
};

struct Crossing {
    char kind = '?';  // L, T or X
    Pair position{};
    float heading = 0.0F, confidence = 0.0F;
};

struct BorderPoint {
    Pair point{}, pixel{};
};

struct Field {
    std::vector<Upright> posts;
    std::vector<Goal> goals;
    std::vector<Upright> robots;
    std::vector<Segment> lines;
    std::optional<Circle> circle;
    std::vector<Crossing> crossings;
    std::vector<BorderPoint> border;
};

struct Frame {
    std::uint32_t number = 0;
    double time = 0.0;  // [s] of capture, on CLOCK_MONOTONIC
    double wall = 0.0;  // [s] of capture, since 1970
    std::uint32_t points = 0;
    float age_ms = 0.0F, latency_ms = 0.0F, total_ms = 0.0F;
    std::vector<Detection> detections;
    std::optional<Field> field;  // only with a network that knows the classes of the field
};

// One message: a state with its reason, or a frame in a state.
struct Message {
    State state = State::starting;
    double time = 0.0, wall = 0.0;
    std::string reason;
    std::optional<Frame> frame;
};

// Bytes that are not the binary form.
struct ProtocolError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

constexpr std::uint8_t version = 3;                   // of the binary form
constexpr std::size_t header_bytes = 64;
constexpr std::size_t most_bytes = std::size_t{4} << 20;  // a frame full of lines takes a few kilobytes

namespace detail {

// Takes numbers from the front of a message. The lengths are checked before.
class Cursor {
  public:
    explicit Cursor(const std::uint8_t* data) : data_(data) {}

    template <typename Number>
    Number take() {
        Number value;
        std::memcpy(&value, data_, sizeof(Number));
        data_ += sizeof(Number);
        return value;
    }

    template <std::size_t count>
    std::array<float, count> floats() {
        return take<std::array<float, count>>();
    }

    const std::uint8_t* data() const { return data_; }

  private:
    const std::uint8_t* data_;
};

inline std::string class_at(const std::vector<std::string>& names, std::uint32_t number) {
    if (number >= names.size()) throw ProtocolError("a record has a class without a name");
    return names[number];
}

inline Detection detection(Cursor& from, const std::vector<std::string>& names) {
    Detection made;
    made.class_name = class_at(names, from.take<std::uint32_t>());
    made.confidence = from.take<float>();
    made.position = from.floats<3>();
    made.distance = from.take<float>();
    made.bearing = from.floats<3>();
    made.center = from.floats<2>();
    made.radius = from.take<float>();
    made.angular_radius = from.take<float>();
    made.distance_by_angle = from.take<float>();
    made.distances_agree = from.take<std::uint32_t>() != 0;
    made.points = from.take<std::uint32_t>();
    Track track;
    track.id = from.take<std::uint32_t>();
    track.position = from.floats<3>();
    track.velocity = from.floats<2>();
    track.position_error = from.take<float>();
    track.velocity_error = from.take<float>();
    if (track.id != 0) made.track = track;
    return made;
}

inline Upright upright(Cursor& from, const std::vector<std::string>& names) {
    Upright made;
    made.class_name = class_at(names, from.take<std::uint32_t>());
    made.confidence = from.take<float>();
    made.position = from.floats<2>();
    made.distance = from.take<float>();
    made.bearing = from.floats<3>();
    made.pixel = from.floats<2>();
    made.width = from.take<float>();
    return made;
}

inline Segment segment(Cursor& from) {
    Segment made;
    for (auto* pairs : {&made.ends, &made.pixels})
        for (Pair& pair : *pairs) pair = from.floats<2>();
    made.confidence = from.take<float>();
    return made;
}

inline Circle circle(Cursor& from) {
    Circle made;
    made.center = from.floats<2>();
    made.radius = from.take<float>();
    made.arc = from.take<float>();
    made.confidence = from.take<float>();
    return made;
}

inline Crossing crossing(Cursor& from) {
    Crossing made;
    made.kind = static_cast<char>(from.take<std::uint32_t>());
    made.position = from.floats<2>();
    made.heading = from.take<float>();
    made.confidence = from.take<float>();
    return made;
}

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
    const std::size_t length = std::size_t{4} + detail::Cursor(data).take<std::uint32_t>();
    if (length < header_bytes || length > most_bytes)
        throw ProtocolError("a message of " + std::to_string(length) + " bytes; is this vm-detect?");
    return length;
}

// A whole message, with its first four bytes. Throws ProtocolError.
inline Message decode(const std::uint8_t* data, std::size_t size) {
    if (size < header_bytes || message_bytes(data, size) != size) throw ProtocolError("a message was cut off");
    detail::Cursor head(data + 4);
    const auto found = head.take<std::uint8_t>();
    if (found != version)
        throw ProtocolError("version " + std::to_string(found) + " of the binary form, but vm_detect.hpp reads version " +
                            std::to_string(version) + "; use the header of the installed vm-detect");
    const auto kind = head.take<std::uint8_t>(), state = head.take<std::uint8_t>(), has_field = head.take<std::uint8_t>();
    if (kind > 1 || state >= static_cast<std::uint8_t>(State::unreachable)) throw ProtocolError("an unknown message");
    Message made;
    made.state = static_cast<State>(state);
    made.time = head.take<double>();
    made.wall = head.take<double>();
    Frame frame;
    frame.time = made.time;
    frame.wall = made.wall;
    frame.number = head.take<std::uint32_t>();
    frame.points = head.take<std::uint32_t>();
    frame.age_ms = head.take<float>();
    frame.latency_ms = head.take<float>();
    frame.total_ms = head.take<float>();

    // detections, posts, goals, robots, lines, circle, crossings, border
    constexpr std::array<std::size_t, 8> record_bytes{96, 44, 8, 44, 36, 20, 20, 16};
    const auto counts = head.take<std::array<std::uint16_t, 8>>();
    const std::size_t text_bytes = head.take<std::uint16_t>();
    std::size_t expected = header_bytes + text_bytes;
    for (std::size_t each = 0; each < counts.size(); ++each) expected += counts[each] * record_bytes[each];
    if (expected != size) throw ProtocolError("a message's length does not fit its records");
    std::string text(reinterpret_cast<const char*>(data) + (size - text_bytes), text_bytes);
    if (kind == 0) {
        made.reason = std::move(text);
        return made;
    }

    const std::vector<std::string> names = detail::lines_of(text);
    detail::Cursor body(data + header_bytes);
    Field field;
    for (int i = 0; i < counts[0]; ++i) frame.detections.push_back(detail::detection(body, names));
    for (int i = 0; i < counts[1]; ++i) field.posts.push_back(detail::upright(body, names));
    for (int i = 0; i < counts[2]; ++i) {
        const auto pair = body.take<std::array<std::uint32_t, 2>>();
        if (std::max(pair[0], pair[1]) >= field.posts.size()) throw ProtocolError("a goal has a post that is not there");
        field.goals.push_back({pair[0], pair[1]});
    }
    for (int i = 0; i < counts[3]; ++i) field.robots.push_back(detail::upright(body, names));
    for (int i = 0; i < counts[4]; ++i) field.lines.push_back(detail::segment(body));
    for (int i = 0; i < counts[5]; ++i) field.circle = detail::circle(body);
    for (int i = 0; i < counts[6]; ++i) field.crossings.push_back(detail::crossing(body));
    for (int i = 0; i < counts[7]; ++i) {
        const Pair point = body.floats<2>();
        field.border.push_back({point, body.floats<2>()});
    }
    if (has_field != 0) frame.field = std::move(field);
    made.frame = std::move(frame);
    return made;
}

// Seconds on the clock of Frame::time.
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
        return frame_ && now() - frame_->time <= max_age ? &*frame_ : nullptr;
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
