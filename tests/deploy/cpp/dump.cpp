// Prints all that vm_detect.hpp decodes from the messages on standard input: a name and its numbers per line.
#include <cstdio>
#include <iostream>
#include <iterator>

#include "vm_detect.hpp"

namespace {

void numbers(const char* name, std::initializer_list<double> values) {
    std::printf("%s", name);
    for (double each : values) std::printf(" %.9g", each);
    std::printf("\n");
}

template <std::size_t count>
void numbers(const char* name, const std::array<float, count>& values) {
    std::printf("%s", name);
    for (float each : values) std::printf(" %.9g", static_cast<double>(each));
    std::printf("\n");
}

void upright(const char* name, const vm_detect::Upright& each) {
    std::printf("%s.class %s\n", name, each.class_name.c_str());
    numbers(name, {each.confidence, each.distance, each.width});
    numbers(name, each.position);
    numbers(name, each.bearing);
    numbers(name, each.pixel);
}

void print(const vm_detect::Frame& frame) {
    std::printf("times %.17g %.17g\n", frame.time, frame.wall);
    numbers("frame", {static_cast<double>(frame.number), static_cast<double>(frame.points)});
    numbers("ms", {frame.age_ms, frame.latency_ms, frame.total_ms});
    for (const auto& each : frame.detections) {
        std::printf("detection.class %s\n", each.class_name.c_str());
        numbers("detection", {each.confidence, each.distance, each.radius, each.angular_radius, each.distance_by_angle,
                              each.distances_agree ? 1.0 : 0.0, static_cast<double>(each.points)});
        numbers("detection.position", each.position);
        numbers("detection.bearing", each.bearing);
        numbers("detection.center", each.center);
        if (each.track) {
            numbers("track", {static_cast<double>(each.track->id), each.track->position_error, each.track->velocity_error});
            numbers("track.position", each.track->position);
            numbers("track.velocity", each.track->velocity);
        }
    }
    std::printf("field %d\n", frame.field ? 1 : 0);
    if (!frame.field) return;
    for (const auto& each : frame.field->posts) upright("post", each);
    for (const auto& each : frame.field->goals) numbers("goal", {double(each.left), double(each.right)});
    for (const auto& each : frame.field->robots) upright("robot", each);
    for (const auto& each : frame.field->lines) {
        for (const auto& pair : each.ends) numbers("line.end", pair);
        for (const auto& pair : each.pixels) numbers("line.pixel", pair);
        numbers("line", {each.confidence});
    }
    if (const auto& each = frame.field->circle) {
        numbers("circle", {each->radius, each->arc, each->confidence});
        numbers("circle.center", each->center);
    }
    for (const auto& each : frame.field->crossings) {
        std::printf("crossing.kind %c\n", each.kind);
        numbers("crossing", {each.position[0], each.position[1], each.heading, each.confidence});
    }
    for (const auto& each : frame.field->border) {
        numbers("border", each.point);
        numbers("border.pixel", each.pixel);
    }
}

}  // namespace

int main() {
    const std::vector<char> read{std::istreambuf_iterator<char>(std::cin), {}};
    std::vector<std::uint8_t> rest(read.begin(), read.end());
    try {
        while (!rest.empty()) {
            const std::size_t length = vm_detect::message_bytes(rest.data(), rest.size());
            if (length == 0 || length > rest.size()) throw vm_detect::ProtocolError("a message was cut off");
            // A copy of its own, so that a read beyond the message is found.
            const std::vector<std::uint8_t> alone(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(length));
            const vm_detect::Message message = vm_detect::decode(alone.data(), alone.size());
            std::printf("state %s %s\n", vm_detect::name(message.state), message.reason.c_str());
            if (message.frame) print(*message.frame);
            rest.erase(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(length));
        }
    } catch (const vm_detect::ProtocolError& error) {
        std::printf("error %s\n", error.what());
    }
    return 0;
}
