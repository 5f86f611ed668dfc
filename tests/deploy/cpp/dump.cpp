// Prints all that vm_detect.hpp decodes from the messages on standard input: a name and a number per line.
#include <cstdio>
#include <iostream>
#include <iterator>

#include "vm_detect.hpp"

namespace vm_detect {

template <typename Number>
std::enable_if_t<std::is_arithmetic_v<Number>> print(const char* name, Number value) {
    std::printf("%s %.17g\n", name, static_cast<double>(value));
}

void print(const char* name, char value) { std::printf("%s %c\n", name, value); }

void print(const char* name, const std::string& value) { std::printf("%s %s\n", name, value.c_str()); }

// The structures whose functions follow, in printers.hpp.
template <typename Item>
auto print(const char*, const Item& item) -> decltype(print_fields(item)) {
    print_fields(item);
}

template <typename Item, std::size_t count>
void print(const char* name, const std::array<Item, count>& items) {
    for (const Item& each : items) print(name, each);
}

template <typename Item>
void print(const char* name, const std::vector<Item>& items) {
    for (const Item& each : items) print(name, each);
}

template <typename Item>
void print(const char* name, const std::optional<Item>& item) {
    if (item) print(name, *item);
}

#include "printers.hpp"

}  // namespace vm_detect

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
            if (message.frame) print_fields(*message.frame);
            rest.erase(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(length));
        }
    } catch (const vm_detect::ProtocolError& error) {
        std::printf("error %s\n", error.what());
    }
    return 0;
}
