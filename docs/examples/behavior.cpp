// A behavior that walks to the nearest ball and kicks it. Instead of commands to motors, it prints them.
//
//     g++ -std=c++17 -I deploy/cpp docs/examples/behavior.cpp -o behavior
//     vm-detect --camera synthetic --track --output-unix /tmp/lines.sock --output-unix-format binary &
//     ./behavior /tmp/lines.sock
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>

#include "vm_detect.hpp"

namespace {

volatile std::sig_atomic_t stopped = 0;

// Where the ball will be when the next command takes effect [m], ahead (x) and to the left (y).
vm_detect::Pair expected_place(const vm_detect::Detection& ball, double time) {
    if (!ball.track) return {ball.position[0], ball.position[1]};
    const auto later = static_cast<float>(vm_detect::now() - time + 0.1);
    const vm_detect::Track& track = *ball.track;
    return {track.position[0] + later * track.velocity[0], track.position[1] + later * track.velocity[1]};
}

// What the robot does now. Each branch is one of its skills.
std::string decide(const vm_detect::Client& detector) {
    using vm_detect::State;
    const State state = detector.state();
    if (state != State::ok && state != State::degraded)
        return std::string("stand: ") + vm_detect::name(state) + ": " + detector.reason();
    const vm_detect::Frame* frame = detector.frame(0.3);
    if (frame == nullptr) return "stand: no frame is new enough";
    const vm_detect::Detection* nearest = nullptr;
    for (const vm_detect::Detection& each : frame->detections)
        if (each.class_name == "ball" && (nearest == nullptr || each.distance < nearest->distance)) nearest = &each;
    if (nearest == nullptr) return "turn: there is no ball in view";
    const vm_detect::Pair place = expected_place(*nearest, frame->t);
    if (std::hypot(place[0], place[1]) < 0.3F) return "kick: the ball is in front";
    char text[80];
    std::snprintf(text, sizeof(text), "walk: the ball is %.1f m ahead and %.1f m to the left", place[0], place[1]);
    return text;
}

}  // namespace

int main(int argc, char** argv) try {
    std::signal(SIGINT, [](int) { stopped = 1; });
    std::signal(SIGTERM, [](int) { stopped = 1; });
    vm_detect::Client detector(argc > 1 ? argv[1] : "/run/vm-detect/lines.sock");
    std::string last;
    auto next = std::chrono::steady_clock::now();
    while (stopped == 0) {
        detector.update();
        const std::string action = decide(detector);
        if (action != last) {
            std::printf("%.3f %s\n", vm_detect::now(), action.c_str());
            std::fflush(stdout);
            last = action;
        }
        next += std::chrono::milliseconds(10);
        std::this_thread::sleep_until(next);
    }
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "behavior: %s\n", error.what());
    return 2;
}
