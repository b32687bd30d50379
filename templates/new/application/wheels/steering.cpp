// Keeps to the middle between two walls, by range sensors and with a driven wheel on each side.
#if __has_include("cluon-complete.hpp")
#include "cluon-complete.hpp"
#else
#include "cluon/Envelope.hpp"
#include "cluon/OD4Session.hpp"
#include "cluon/cluon.hpp"
#endif

#include "messages.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <iostream>
#include <map>
#include <string>
#include <thread>

// Sender stamps of the range sensors, which look ahead, and ahead to the left and right.
constexpr uint32_t FRONT{0};
constexpr uint32_t LEFT{1};
constexpr uint32_t RIGHT{3};
constexpr float PEDAL{0.4f};
constexpr float GAIN{0.4f};  // in pedal per m
constexpr float STOP{0.2f};  // in m

int main(int argc, char **argv) {
    auto flags = cluon::getCommandlineArguments(argc, argv);
    if (!flags.count("cid")) {
        std::cerr << argv[0] << " --cid=111" << std::endl;
        return 1;
    }
    cluon::OD4Session session{static_cast<uint16_t>(std::stoi(flags["cid"]))};
    int64_t time{0};
    std::map<uint32_t, float> distances;
    session.dataTrigger(opendlv::proxy::DistanceReading::ID(), [&](cluon::data::Envelope &&envelope) {
        const auto sampled = envelope.sampleTimeStamp();
        const auto sensor = envelope.senderStamp();
        if (cluon::time::toMicroseconds(sampled) != time) {
            time = cluon::time::toMicroseconds(sampled);
            distances.clear();
        }
        distances[sensor] = cluon::extractMessage<opendlv::proxy::DistanceReading>(std::move(envelope)).distance();
        if (!distances.count(FRONT) || !distances.count(LEFT) || !distances.count(RIGHT)) {
            return;  // not all sensors have spoken of this time
        }
        const float speed{distances[FRONT] > STOP ? PEDAL : 0.0f};
        const float turn{std::clamp(GAIN * (distances[LEFT] - distances[RIGHT]), -speed, speed)};
        distances.clear();
        opendlv::proxy::PedalPositionRequest left, right;
        left.position(speed - turn);
        session.send(left, sampled, 0);
        right.position(speed + turn);
        session.send(right, sampled, 1);
    });
    while (session.isRunning()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    return 0;
}
