// A ROS 2 node that drives between yellow cones on the left and blue ones on the right.
#include <cstdint>
#include <memory>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/image.hpp"

// Where pixels of a colour are: -0.5 is the left edge of the picture, 0.5 the right one.
class Cones {
   public:
    void see(uint32_t column) {
        m_sum += column;
        m_count++;
    }
    double middle(uint32_t width, double without) const {
        return m_count ? static_cast<double>(m_sum) / m_count / width - 0.5 : without;
    }

   private:
    uint64_t m_sum{0};
    uint64_t m_count{0};
};

class Steering : public rclcpp::Node {
   public:
    Steering() : Node("steering") {
        m_velocity = create_publisher<geometry_msgs::msg::Twist>("cmd_vel", 10);
        m_pictures = create_subscription<sensor_msgs::msg::Image>(
            "camera/image_raw", rclcpp::SensorDataQoS(), [this](sensor_msgs::msg::Image::ConstSharedPtr image) { look(*image); });
    }

   private:
    // Answers a picture, in the encoding bgr8 or bgra8, with a velocity.
    void look(const sensor_msgs::msg::Image &image) {
        Cones yellow, blue;
        for (uint32_t row = image.height * 7 / 12; row < image.height * 17 / 24; row++) {
            const uint8_t *pixel = image.data.data() + row * image.step;
            for (uint32_t column = 0; column < image.width; column++, pixel += image.step / image.width) {
                if (pixel[1] - pixel[0] > 80) yellow.see(column);
                if (pixel[0] - pixel[2] > 20) blue.see(column);
            }
        }
        geometry_msgs::msg::Twist answer;
        answer.linear.x = 0.5;  // m/s
        answer.angular.z = -2 * (yellow.middle(image.width, -0.5) + blue.middle(image.width, 0.5));  // rad/s
        m_velocity->publish(answer);
    }

    rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr m_velocity;
    rclcpp::Subscription<sensor_msgs::msg::Image>::SharedPtr m_pictures;
};

int main(int argc, char **argv) {
    rclcpp::init(argc, argv);
    rclcpp::spin(std::make_shared<Steering>());
    rclcpp::shutdown();
    return 0;
}
