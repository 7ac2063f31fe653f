// Stands for a network and for a viewer, over eProsima Fast DDS: answers every image to be labelled with its
// labels, floods the label topic, prints what it receives, until its standard input ends.
// usage: dds_labeller [domain=0] [topic=/segmentation/labels] [delay=0] (s, of an answer; negative: none)
//   [label=1] (of every pixel) [flood=0] (images/s: by turns well-formed ones of the past, of the future, of
//   another size, of another encoding, shorter than they say) [width=752] [height=480] (of those)
//   [dump=0] (1: every message's fields, one line each)
// Ends with a line "labeller IMAGES ANSWERS FLOODED".

#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/drivers/dds/fast_peer.hpp"
#include "tests/drivers/dds/test_messages.hpp"

namespace {

using namespace swiftlet::test;
using Clock = std::chrono::steady_clock;
using Image = sensor_msgs::msg::dds_::Image_;

std::mutex print_mutex;

/// One line of text at a time, whichever thread it comes from.
class Line {
 public:
  explicit Line(const char* topic) : text_(topic) {}
  ~Line() {
    const std::lock_guard lock(print_mutex);
    std::printf("%s\n", text_.c_str());
    std::fflush(stdout);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  /// Spaces within a text become _, an empty one -.
  Line& operator<<(std::string text) {
    if (text.empty()) text = "-";
    for (char& c : text) c = c == ' ' ? '_' : c;
    text_ += " " + text;
    return *this;
  }
  Line& operator<<(double value) {
    char text[40];
    std::snprintf(text, sizeof text, " %.17g", value);
    text_ += text;
    return *this;
  }
  Line& operator<<(const std_msgs::msg::dds_::Header_& header) {
    text_ += " " + std::to_string(nanosecondsOf(header));
    return *this << header.frame_id();
  }
  template <typename Vector>
  requires requires(const Vector& v) { v.z(); }
  Line& operator<<(const Vector& v) {
    *this << v.x() << v.y() << v.z();
    if constexpr (requires { v.w(); }) *this << v.w();
    return *this;
  }

 private:
  std::string text_;
};

void dump(const nav_msgs::msg::dds_::Odometry_& m) {
  Line line("odometry");
  line << m.header() << m.child_frame_id() << m.pose().pose().position() << m.pose().pose().orientation()
       << m.twist().twist().linear() << m.twist().twist().angular();
  for (const double value : m.pose().covariance()) line << value;
  for (const double value : m.twist().covariance()) line << value;
}

void dump(const tf2_msgs::msg::dds_::TFMessage_& m) {
  Line line("tf");
  line << static_cast<double>(m.transforms().size());
  for (const auto& t : m.transforms()) {
    line << t.header() << t.child_frame_id() << t.transform().translation() << t.transform().rotation();
  }
}

void dump(const visualization_msgs::msg::dds_::Marker_& m) {
  Line line("local_mesh");
  line << m.header() << m.ns() << m.id() << m.type() << m.action() << m.pose().position()
       << m.pose().orientation() << m.scale() << m.lifetime().sec() << m.lifetime().nanosec()
       << static_cast<double>(m.points().size()) << static_cast<double>(m.colors().size());
  for (const auto& p : m.points()) line << p;
  for (const auto& c : m.colors()) line << c.r() << c.g() << c.b() << c.a();
}

/// Numbers of 32 bits, the last `integers` of a point no floats.
void dump(const char* topic, std::size_t integers, const sensor_msgs::msg::dds_::PointCloud2_& m) {
  Line line(topic);
  line << m.header() << m.height() << m.width() << m.point_step() << m.row_step() << m.is_bigendian()
       << m.is_dense() << static_cast<double>(m.fields().size());
  for (const auto& f : m.fields()) line << f.name() << f.offset() << f.datatype() << f.count();
  const std::size_t numbers = m.point_step() / 4;
  for (std::size_t i = 0; 4 * (i + 1) <= m.data().size(); ++i) {
    float real = 0;
    std::uint32_t integer = 0;
    std::memcpy(&real, m.data().data() + 4 * i, 4);
    std::memcpy(&integer, m.data().data() + 4 * i, 4);
    line << (i % numbers + integers < numbers ? static_cast<double>(real) : integer);
  }
}

void dump(const diagnostic_msgs::msg::dds_::DiagnosticArray_& m) {
  Line line("diagnostics");
  line << m.header() << static_cast<double>(m.status().size());
  for (const auto& s : m.status()) {
    line << s.level() << s.name() << s.message() << s.hardware_id() << static_cast<double>(s.values().size());
    for (const auto& v : s.values()) line << v.key() << v.value();
  }
}

void dump(const Image& m) {
  Line line("mapped_image");
  line << m.header() << m.height() << m.width() << m.encoding() << m.is_bigendian() << m.step()
       << static_cast<double>(m.data().size());
  double sum = 0;
  for (std::size_t i = 0; i < m.data().size(); ++i) sum += static_cast<double>(i % 101) * m.data()[i];
  line << sum;
}

/// Image n of a flood.
void spoil(Image& image, std::uint64_t n, std::uint32_t width, std::uint32_t height) {
  image.header().stamp().sec(n % 5 == 1 ? 2'000'000'000 : 1);
  image.header().stamp().nanosec(static_cast<std::uint32_t>(n % 1'000'000'000));
  image.width(n % 5 == 2 ? width + 8 : width);
  image.height(height);
  image.step(image.width());
  image.encoding(n % 5 == 3 ? "16UC1" : "mono8");
  image.data().resize(static_cast<std::size_t>(image.step()) * (n % 5 == 4 ? height / 2 : height));
}

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, std::string> options = {
      {"domain", "0"}, {"topic", kDdsLabelTopic}, {"delay", "0"},    {"label", "1"},
      {"flood", "0"},  {"width", "752"},          {"height", "480"}, {"dump", "0"}};
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || !options.contains(text.substr(0, equals))) {
      std::fprintf(stderr, "dds_labeller: unknown argument %s\n", argv[i]);
      return 2;
    }
    options[text.substr(0, equals)] = text.substr(equals + 1);
  }
  const auto number = [&](const char* name) { return std::atof(options[name].c_str()); };
  const bool prints = number("dump") != 0;
  const double delay = number("delay");
  const double flood = number("flood");

  struct Question {
    Clock::time_point due;
    Image image;
  };
  std::mutex mutex;
  std::deque<Question> questions;
  std::uint64_t images = 0, answers = 0, flooded = 0;
  const auto show = [prints](const auto& message) {
    if (prints) dump(message);
  };
  auto on_image = listener<Image>([&](const Image& image) {
    show(image);
    const std::lock_guard lock(mutex);
    ++images;
    if (delay < 0) return;
    questions.push_back(
        {Clock::now() + std::chrono::microseconds(static_cast<std::int64_t>(1e6 * delay)), image});
  });
  auto on_odometry = listener<nav_msgs::msg::dds_::Odometry_>(show);
  auto on_transforms = listener<tf2_msgs::msg::dds_::TFMessage_>(show);
  auto on_mesh = listener<visualization_msgs::msg::dds_::Marker_>(show);
  using Cloud = sensor_msgs::msg::dds_::PointCloud2_;
  auto on_cloud = listener<Cloud>([](const Cloud& cloud) { dump("surface", 2, cloud); });
  auto on_obstacle = listener<Cloud>([](const Cloud& cloud) { dump("nearest_obstacle", 1, cloud); });
  auto on_diagnostics = listener<diagnostic_msgs::msg::dds_::DiagnosticArray_>(show);
  const std::string prefix = kDdsPrefix;
  {
    Peer peer(static_cast<std::uint32_t>(number("domain")));
    peer.read<sensor_msgs::msg::dds_::Image_PubSubType>(prefix + "/mapped_image", on_image);
    if (prints) {
      peer.read<nav_msgs::msg::dds_::Odometry_PubSubType>(prefix + "/odometry", on_odometry);
      peer.read<tf2_msgs::msg::dds_::TFMessage_PubSubType>("/tf", on_transforms);
      peer.read<visualization_msgs::msg::dds_::Marker_PubSubType>(prefix + "/local_mesh", on_mesh);
      peer.read<sensor_msgs::msg::dds_::PointCloud2_PubSubType>(prefix + "/surface", on_cloud);
      peer.read<sensor_msgs::msg::dds_::PointCloud2_PubSubType>(prefix + "/nearest_obstacle", on_obstacle);
      peer.read<diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType>("/diagnostics", on_diagnostics);
    }
    fast::DataWriter* labels = peer.writer<sensor_msgs::msg::dds_::Image_PubSubType>(options["topic"]);
    Image wrong;
    wrong.header().frame_id("cam0");
    auto next_wrong = Clock::now();
    for (pollfd input{STDIN_FILENO, POLLIN, 0}; ::poll(&input, 1, flood > 0 ? 0 : 2) == 0;) {
      for (;;) {
        Question question;
        {
          const std::lock_guard lock(mutex);
          if (questions.empty() || questions.front().due > Clock::now()) break;
          question = std::move(questions.front());
          questions.pop_front();
        }
        Image& image = question.image;
        image.data().assign(image.data().size(), static_cast<std::uint8_t>(number("label")));
        if (labels->write(&image)) ++answers;
      }
      if (flood <= 0) continue;
      std::this_thread::sleep_until(next_wrong);
      next_wrong = std::max(next_wrong + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / flood)),
                            Clock::now() - std::chrono::milliseconds(50));
      spoil(wrong, flooded, static_cast<std::uint32_t>(number("width")),
            static_cast<std::uint32_t>(number("height")));
      if (labels->write(&wrong)) ++flooded;
    }
  }
  std::printf("labeller %llu %llu %llu\n", static_cast<unsigned long long>(images),
              static_cast<unsigned long long>(answers), static_cast<unsigned long long>(flooded));
  return 0;
}
