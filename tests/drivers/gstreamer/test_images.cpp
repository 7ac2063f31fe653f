// Images and stamps out of pipelines, beside GStreamer's own bytes and beside the clock.

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/image/grey_reader.hpp"
#include "tests/drivers/gstreamer/feed_element.hpp"
#include "tests/drivers/gstreamer/frames.hpp"
#include "tests/firmware_host/scratch_folder.hpp"
#include "tests/support/statistics.hpp"
#include "tests/support/text.hpp"

namespace swiftlet {
namespace {

using test::awaitFrame;
using test::largestDifference;
using test::pipeline;

struct Format {
  const char* name;
  int step;   ///< bytes from pixel to pixel in a row
  int first;  ///< byte of a row's first luma
};
constexpr std::array kFormats = {Format{"GRAY8", 1, 0}, Format{"GRAY16_LE", 2, 1}, Format{"NV12", 1, 0},
                                 Format{"NV21", 1, 0},  Format{"I420", 1, 0},      Format{"YV12", 1, 0},
                                 Format{"NV16", 1, 0},  Format{"Y42B", 1, 0},      Format{"YUY2", 2, 0},
                                 Format{"YVYU", 2, 0},  Format{"UYVY", 2, 1},      Format{"VYUY", 2, 1}};

/// Still, with all levels of grey and colours.
std::string pattern(const std::string& format, int width, int height) {
  return "videotestsrc pattern=smpte-rp-219 ! video/x-raw,format=" + format +
         ",width=" + std::to_string(width) + ",height=" + std::to_string(height) + ",framerate=50/1";
}

/// One image's bytes as gst-launch-1.0 writes them to a file.
std::vector<std::uint8_t> bytesOf(const std::string& source, const std::string& file) {
  const std::string text = source + " ! identity eos-after=2 ! filesink location=" + file;
  GstElement* made = gst_parse_launch(text.c_str(), nullptr);
  REQUIRE(made != nullptr);
  gst_element_set_state(made, GST_STATE_PLAYING);
  GstBus* bus = gst_element_get_bus(made);
  GstMessage* end = gst_bus_timed_pop_filtered(
      bus, 10 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  REQUIRE(end != nullptr);
  CHECK(GST_MESSAGE_TYPE(end) == GST_MESSAGE_EOS);
  gst_message_unref(end);
  gst_object_unref(bus);
  gst_element_set_state(made, GST_STATE_NULL);
  gst_object_unref(made);
  return test::bytesOf(file);
}

std::vector<std::uint8_t> greyOf(PipelineSource& source) {
  REQUIRE(source.open().ok());
  GreyReader reader;
  reader.reserve(source.facts().format, source.facts().width, source.facts().height, false);
  const CapturedFrame frame = awaitFrame(source);
  REQUIRE(frame.valid());
  const auto images = reader.read(frame.image);
  REQUIRE(images.size() == 1);
  std::vector<std::uint8_t> grey;
  for (int y = 0; y < images[0].height; ++y) {
    grey.insert(grey.end(), images[0].row(y), images[0].row(y) + images[0].width);
  }
  return grey;
}

TEST_CASE("The grey of each format is the luma of the bytes that GStreamer writes", "[gstreamer]") {
  gst_init(nullptr, nullptr);
  const ScratchFolder folder("gstreamer_images");
  for (const auto& [width, height] : {std::pair{752, 480}, {754, 482}, {62, 46}}) {
    PipelineSource plain(pipeline(pattern("GRAY8", width, height), width, height, 50));
    const std::vector<std::uint8_t> grey8 = greyOf(plain);
    for (const Format& format : kFormats) {
      INFO(format.name << ' ' << width << 'x' << height);
      const std::string text = pattern(format.name, width, height);
      PipelineSource source(pipeline(text, width, height, 50));
      const std::vector<std::uint8_t> grey = greyOf(source);
      // Rows of GStreamer's files are padded to four bytes.
      const std::vector<std::uint8_t> bytes = bytesOf(text, folder.file("image"));
      const int stride = (width * format.step + 3) / 4 * 4;
      std::vector<std::uint8_t> luma;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          luma.push_back(bytes.at(static_cast<std::size_t>(y * stride + x * format.step + format.first)));
        }
      }
      CHECK(largestDifference(grey, luma) == 0);
      const int to_grey8 = largestDifference(grey, grey8);
      CHECK(to_grey8 <= 1);
      CHECK(*std::ranges::max_element(grey) > *std::ranges::min_element(grey) + 200);
    }
  }
}

TEST_CASE("A side-by-side image is asked for at the width of both halves", "[gstreamer]") {
  PipelineSource source(pipeline(pattern("NV12", 128, 48), 128, 48, 50));
  REQUIRE(source.open().ok());
  GreyReader reader;
  reader.reserve(source.facts().format, 128, 48, true);
  const CapturedFrame frame = awaitFrame(source);
  REQUIRE(frame.valid());
  const auto halves = reader.read(frame.image);
  REQUIRE(halves.size() == 2);
  CHECK(halves[1].data == halves[0].data + 64);
}

TEST_CASE("A live source's stamps are the clock's, and are told apart from arrivals", "[gstreamer]") {
  constexpr double kRate = 100;
  constexpr int kFrames = 200;
  const Stamp before = monotonicNow();
  PipelineSource source(
      pipeline("videotestsrc is-live=true ! video/x-raw,format=NV12,width=64,height=48,framerate=100/1", 64,
               48, kRate));
  REQUIRE(source.open().ok());
  CHECK(source.warnings().empty());
  CHECK(source.facts().event == StampEvent::kStartOfExposure);
  CHECK(source.facts().rate == kRate);
  CHECK(std::string(source.facts().card.data()) == "videotestsrc");
  std::vector<double> off, late;
  std::optional<Stamp> first;
  std::uint64_t first_number = 0;
  for (int i = 0; i < kFrames; ++i) {
    const CapturedFrame frame = awaitFrame(source);
    REQUIRE(frame.valid());
    CHECK(frame.event == StampEvent::kStartOfExposure);
    if (!first) {
      first = frame.stamp;
      first_number = frame.sequence;
    }
    const Duration due = Duration::fromSeconds(static_cast<double>(frame.sequence - first_number) / kRate);
    off.push_back(std::abs((frame.stamp - *first - due).seconds()) * 1e6);
    late.push_back((frame.arrival - frame.stamp).seconds() * 1e3);
  }
  CHECK(*first >= before);
  std::ranges::sort(off);
  std::ranges::sort(late);
  std::cout << "gstreamer: stamps of a live source off its grid by at most " << off.back()
            << " us; arrival - stamp: median " << late[kFrames / 2] << " ms, 99 % "
            << late[kFrames * 99 / 100] << " ms, least " << late.front() << " ms\n";
  CHECK(off.back() < 1);  // us: GStreamer's own rounding of 1 / rate
  CHECK(late.front() >= 0);
  CHECK(late[kFrames / 2] < 10);
  CHECK(source.counters().stamp_ahead == 0);
}

/// Images of one grey at given times after the capture.
class TimedFeed : public test::Feed {
 public:
  bool timed = true;
  bool numbered = false;
  std::atomic<bool> paused{false};
  std::vector<Stamp> captures = std::vector<Stamp>(10'000);
  std::atomic<std::size_t> count{0};

  Next next(test::FedImage& image) override {
    const Stamp now = monotonicNow();
    if (paused.load() || now < due_) return Next::kWait;
    constexpr Duration kPeriod = Duration::fromMilliseconds(10);
    due_ = now + kPeriod;
    const std::size_t n = count.load();
    // As of a camera that exposes and transfers.
    constexpr Duration kTransfer = Duration{3'141'592};
    captures.at(n) = now - kTransfer;
    image.bytes.assign(64 * 48, static_cast<std::uint8_t>(n));
    if (timed) image.capture = captures[n];
    if (numbered) image.number = n;
    count.store(n + 1);
    return Next::kImage;
  }

 private:
  Stamp due_;
};

constexpr const char* kTimedFeed =
    "feedsrc feed=0 ! video/x-raw,format=GRAY8,width=64,height=48,framerate=100/1";

TEST_CASE("A stamp is the moment of capture that the source gives, to the nanosecond", "[gstreamer]") {
  TimedFeed feed;
  feed.numbered = true;
  test::setFeed(0, &feed);
  {
    PipelineSource source(pipeline(kTimedFeed, 64, 48, 100));
    REQUIRE(source.open().ok());
    for (int i = 0; i < 50; ++i) {
      const CapturedFrame frame = awaitFrame(source);
      REQUIRE(frame.valid());
      // The image's grey is its number.
      CHECK(frame.stamp.ns == feed.captures.at(frame.image.row(0)[0]).ns);
      CHECK(frame.arrival > frame.stamp);
    }
  }
  test::setFeed(0, nullptr);
}

TEST_CASE("Without times of capture the arrival is the stamp, and a warning says so", "[gstreamer]") {
  TimedFeed feed;
  feed.timed = false;
  test::setFeed(0, &feed);
  for (const std::string& text :
       {std::string(kTimedFeed), std::string("videotestsrc is-live=true do-timestamp=true ! "
                                             "video/x-raw,width=64,height=48,framerate=100/1")}) {
    PipelineSource source(pipeline(text, 64, 48, 100));
    REQUIRE(source.open().ok());
    CHECK(source.facts().event == StampEvent::kArrival);
    REQUIRE(source.warnings().size() == 1);
    CHECK_THAT(std::string(source.warnings()[0].text()), Catch::Contains("no capture times"));
    const CapturedFrame frame = awaitFrame(source);
    REQUIRE(frame.valid());
    CHECK(frame.event == StampEvent::kArrival);
    CHECK(frame.stamp <= frame.arrival);
    CHECK((monotonicNow() - frame.stamp).seconds() < 1);
  }
  test::setFeed(0, nullptr);
}

/// Whether sequence numbers advance as stamps do, for `frames` frames.
void checkSequence(PipelineSource& source, int frames, double rate) {
  std::optional<Stamp> stamp;
  std::uint64_t number = 0;
  for (int i = 0; i < frames; ++i) {
    const CapturedFrame frame = awaitFrame(source);
    REQUIRE(frame.valid());
    if (stamp) {
      const double periods = (frame.stamp - *stamp).seconds() * rate;
      CHECK(static_cast<double>(frame.sequence - number) == Approx(periods).margin(0.01));
    }
    stamp = frame.stamp;
    number = frame.sequence;
  }
}

TEST_CASE("Frames that lack are counted: dropped in the pipeline, and not fetched in time", "[gstreamer]") {
  PipelineSource source(
      pipeline("videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=100/1 ! "
               "identity drop-probability=0.3",
               64, 48, 100));
  REQUIRE(source.open().ok());
  checkSequence(source, 100, 100);
  const std::uint64_t dropped = source.counters().missed;
  CHECK(dropped > 15);  // of 143, 43 as a rule
  CHECK(dropped < 80);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  checkSequence(source, 20, 100);
  CHECK(source.counters().missed > dropped + 40);

  // A source that numbers nothing: what came and was not fetched.
  TimedFeed feed;
  test::setFeed(0, &feed);
  {
    PipelineSource fed(pipeline(kTimedFeed, 64, 48, 100));
    REQUIRE(fed.open().ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    feed.paused.store(true);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    CapturedFrame frame;
    while (fed.next(frame).ok() && frame.valid()) {
    }
    feed.paused.store(false);
    frame = awaitFrame(fed);
    REQUIRE(frame.valid());
    CHECK(frame.sequence == frame.image.row(0)[0]);  // counted from the second image on, whose grey is 1
    CHECK(fed.counters().missed + fed.counters().frames == frame.sequence);
    CHECK(fed.counters().missed > 10);
  }
  test::setFeed(0, nullptr);
}

}  // namespace
}  // namespace swiftlet
