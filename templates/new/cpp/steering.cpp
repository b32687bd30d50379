// Drives between yellow cones on the left and blue ones on the right.
#if __has_include("cluon-complete.hpp")
#include "cluon-complete.hpp"
#else
#include "cluon/OD4Session.hpp"
#include "cluon/SharedMemory.hpp"
#include "cluon/cluon.hpp"
#endif

#include "messages.hpp"

#include <cstdint>
#include <iostream>
#include <string>

constexpr int WIDTH{640};
constexpr int FIRST_ROW{280};
constexpr int LAST_ROW{340};

// Where pixels of a colour are: -0.5 is the left edge of the picture, 0.5 the right one.
class Cones {
   public:
    void see(int column) {
        m_sum += column;
        m_count++;
    }
    double middle(double without) const {
        return m_count ? static_cast<double>(m_sum) / m_count / WIDTH - 0.5 : without;
    }

   private:
    long m_sum{0};
    long m_count{0};
};

// The steering angle in rad, positive to the left, for a picture in B, G, R, A.
double steer(const uint8_t *picture) {
    Cones yellow, blue;
    for (int row{FIRST_ROW}; row < LAST_ROW; row++) {
        for (int column{0}; column < WIDTH; column++) {
            const uint8_t *pixel{picture + 4 * (row * WIDTH + column)};
            if (pixel[1] - pixel[0] > 80) {
                yellow.see(column);
            }
            if (pixel[0] - pixel[2] > 20) {
                blue.see(column);
            }
        }
    }
    return -(yellow.middle(-0.5) + blue.middle(0.5));
}

int main(int argc, char **argv) {
    auto flags = cluon::getCommandlineArguments(argc, argv);
    if (!flags.count("cid") || !flags.count("name")) {
        std::cerr << argv[0] << " --cid=111 --name=video0.argb" << std::endl;
        return 1;
    }
    cluon::OD4Session session{static_cast<uint16_t>(std::stoi(flags["cid"]))};
    cluon::SharedMemory memory{flags["name"]};
    while (session.isRunning() && memory.valid()) {
        memory.wait();  // the camera notifies of each frame
        memory.lock();
        const auto sampled = memory.getTimeStamp().second;
        const double angle = steer(reinterpret_cast<const uint8_t *>(memory.data()));
        memory.unlock();

        opendlv::proxy::GroundSteeringRequest steering;
        steering.groundSteering(static_cast<float>(angle));
        session.send(steering, sampled);
        opendlv::proxy::PedalPositionRequest pedal;
        pedal.position(0.1f);
        session.send(pedal, sampled);
    }
    return 0;
}
