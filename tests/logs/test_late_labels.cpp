// Labels that come after their images: the exchange between the map and who brings them, what the map holds
// back and for how long, and whole runs with a network that answers late, never, and amid a flood.

#include <atomic>
#include <catch2/catch.hpp>
#include <deque>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "estimator/core/random.hpp"
#include "firmware_host/graph/held_frames.hpp"
#include "firmware_host/graph/run_observer.hpp"
#include "firmware_host/inputs/log/log_player.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/schedule/threaded.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/logs/silent_listener.hpp"
#include "tests/sanitized.hpp"

namespace swiftlet {
namespace {

constexpr int kWidth = 16;
constexpr int kHeight = 12;
constexpr Duration kPatience = Duration::fromMilliseconds(500);

/// All pixels alike.
struct Plain {
  explicit Plain(int value, int width = kWidth, int height = kHeight)
      : pixels(static_cast<std::size_t>(width * height), static_cast<std::uint8_t>(value)),
        view{pixels.data(), width, height, width} {}
  std::vector<std::uint8_t> pixels;
  ImageView view;
};

/// Whether all pixels are of this value.
bool isPlain(const ImageView& image, int value) {
  for (int i = 0; i < image.width * image.height; ++i) {
    if (image.data[i] != static_cast<std::uint8_t>(value)) return false;
  }
  return !image.empty();
}

Stamp at(int n) { return {std::int64_t{n} * 50'000'000}; }

TEST_CASE("labels go to the place that waits for their stamp, exactly") {
  LabelExchange exchange(kWidth, kHeight, kPatience);
  const int a = exchange.open(at(1), Plain(1).view);
  const int b = exchange.open(at(2), Plain(2).view);
  REQUIRE(a >= 0);
  REQUIRE(b >= 0);
  CHECK(isPlain(exchange.image(b), 2));
  exchange.offer(at(2) + Duration{1}, Plain(9).view);  // early, by one nanosecond of nobody's
  exchange.offer(at(2), Plain(12).view);
  CHECK_FALSE(exchange.isLabelled(a));
  CHECK(exchange.isLabelled(b));
  exchange.offer(at(2), Plain(13).view);  // again: the first stay
  exchange.offer(at(1) - Duration{1}, Plain(9).view);
  CHECK(exchange.counters().unawaited == 2);
  exchange.offer(at(1), Plain(9, kWidth, kHeight + 1).view);
  exchange.offer(at(1), ImageView{});
  CHECK(exchange.counters().wrong_size == 2);
  REQUIRE(exchange.tryClose(b));
  CHECK(isPlain(exchange.labels(b), 12));
  REQUIRE(exchange.tryClose(a));
  CHECK(exchange.labels(a).empty());
  exchange.offer(at(1), Plain(9).view);  // too late
  CHECK(exchange.counters().unawaited == 3);
  CHECK(exchange.labels(a).empty());
  exchange.free(a);
  exchange.free(b);
  const int c = exchange.open(at(3), Plain(3).view);
  exchange.retryEarly();  // what was of nobody's goes
  CHECK(exchange.counters().unawaited == 4);
  REQUIRE(exchange.tryClose(c));
  CHECK(exchange.labels(c).empty());
}

TEST_CASE("labels of who watches the camera himself wait for the frame") {
  LabelExchange exchange(kWidth, kHeight, kPatience);
  for (int n = 1; n <= 5; ++n) exchange.offer(at(n), Plain(10 + n).view);
  CHECK(exchange.counters().unawaited == 1);  // four wait
  exchange.retryEarly();
  CHECK(exchange.counters().unawaited == 1);
  for (int n = 1; n <= 5; ++n) {
    const int place = exchange.open(at(n), Plain(n).view);
    exchange.retryEarly();
    REQUIRE(exchange.tryClose(place));
    CHECK(exchange.labels(place).empty() == (n == 1));
    if (n > 1) CHECK(isPlain(exchange.labels(place), 10 + n));
    exchange.free(place);
  }
  CHECK(exchange.counters().taken == 4);
}

TEST_CASE("every image is shown once, the oldest first, and no place is closed meanwhile") {
  LabelExchange exchange(kWidth, kHeight, kPatience);
  std::vector<int> places;
  for (int n = 1; n <= static_cast<int>(LabelExchange::kPlaces); ++n) {
    places.push_back(exchange.open(at(n), Plain(n).view));
  }
  CHECK(exchange.open(at(99), Plain(99).view) == -1);
  REQUIRE(exchange.tryClose(places[0]));
  exchange.offer(at(2), Plain(12).view);  // labelled: nobody needs to see it any more
  for (int n = 3; n <= static_cast<int>(LabelExchange::kPlaces); ++n) {
    CHECK(exchange.show([&](Stamp stamp, const ImageView& image) {
      CHECK(stamp == at(n));
      CHECK(isPlain(image, n));
      CHECK_FALSE(exchange.tryClose(places[static_cast<std::size_t>(n - 1)]));
    }));
  }
  CHECK_FALSE(exchange.show([](Stamp, const ImageView&) { FAIL(); }));
  CHECK(exchange.counters().shown == LabelExchange::kPlaces - 2);
  for (std::size_t i = 1; i < places.size(); ++i) CHECK(exchange.tryClose(places[i]));
}

TEST_CASE("the exchange between two threads: nothing torn, all accounted for") {
  LabelExchange exchange(kWidth, kHeight, kPatience);
  constexpr int kFrames = kSanitized ? 3000 : 30'000;
  constexpr int kValues = 90;  // image n is plain n % 90, its labels 100 more
  const auto valueOf = [](Stamp stamp) { return static_cast<int>(stamp.ns / at(1).ns % kValues); };
  std::atomic<bool> ended{false};
  std::atomic<int> torn{0};
  std::thread other([&] {
    Random random(3);
    std::vector<Stamp> seen;
    while (!ended.load()) {
      while (exchange.show([&](Stamp stamp, const ImageView& image) {
        seen.push_back(stamp);
        if (!isPlain(image, valueOf(stamp))) ++torn;
      })) {
      }
      exchange.retryEarly();
      exchange.offer(at(static_cast<int>(random.below(kFrames))) + Duration{1}, Plain(200).view);  // wrong
      if (!seen.empty()) {
        const Stamp stamp = seen[random.below(static_cast<std::uint32_t>(seen.size()))];
        exchange.offer(stamp, Plain(valueOf(stamp) + 100).view);
        if (seen.size() > LabelExchange::kPlaces) seen.clear();
      }
    }
  });
  Random random(4);
  std::deque<std::pair<int, int>> open;  // place, frame
  std::uint64_t labelled = 0;
  const auto close = [&] {
    const auto [place, n] = open.front();
    if (!exchange.tryClose(place)) return;
    const ImageView labels = exchange.labels(place);
    if (!labels.empty()) ++labelled;
    if (!labels.empty() && !isPlain(labels, n % kValues + 100)) ++torn;
    exchange.free(place);
    open.pop_front();
  };
  // On a busy machine the other side may not have its turn for long.
  for (int n = 0; n < kFrames || (labelled < 100 && n < 500 * kFrames);) {
    if (open.size() == LabelExchange::kPlaces || (!open.empty() && random.below(3) == 0)) close();
    if (open.size() == LabelExchange::kPlaces) continue;
    const int place = exchange.open(at(n), Plain(n % kValues).view);
    REQUIRE(place >= 0);
    open.emplace_back(place, n++);
  }
  while (!open.empty()) close();
  ended.store(true);
  other.join();
  CHECK(torn == 0);
  const LabelExchange::Counters& counters = exchange.counters();
  CHECK(counters.taken == labelled);
  CHECK(counters.taken + counters.unawaited <= counters.offered);
  CHECK(counters.taken + counters.unawaited + LabelExchange::kEarly >= counters.offered);
  CHECK(labelled > 0);
}

/// The map's side without a map.
struct Bench {
  LabelExchange exchange{kWidth, kHeight, kPatience};
  HeldFrames held{exchange, {std::size_t{kWidth} * kHeight, std::size_t{kWidth} * kHeight}, 0};
  double now = 100;

  void hold(int n, const SceneImages& scene = {}) {
    const Plain pixels(n);
    KeyframeImages images;
    images.image = {pixels.view, pixels.view};
    MapMessage message;
    message.frame = static_cast<std::uint64_t>(n);
    message.stamp = at(n);
    held.hold(message, &images, scene, now);
  }
  /// Number of the frame that is mapped now, 0: none; `label` gets its labels' value, 0: none.
  int map(int& label) {
    const HeldFrames::Frame* frame = held.due(now);
    if (frame == nullptr) return 0;
    const int n = static_cast<int>(frame->message.frame);
    CHECK(frame->scene.stamp == at(n));
    for (const ImageView& image : frame->image) CHECK(isPlain(image, n));
    label = frame->scene.labels.empty() ? 0 : frame->scene.labels.data[0];
    held.drop();
    return n;
  }
};

TEST_CASE("held frames are mapped in their order, with labels or once they waited long enough") {
  Bench bench;
  int label = -1;
  bench.exchange.setLabeller(true);
  CHECK(bench.map(label) == 0);
  bench.hold(1);
  bench.now += 0.2;
  bench.hold(2);
  bench.exchange.offer(at(2), Plain(12).view);
  CHECK(bench.map(label) == 0);  // the older first
  bench.now += 0.25;
  CHECK(bench.map(label) == 0);
  bench.now += 0.1;
  CHECK(bench.map(label) == 1);
  CHECK(label == 0);
  CHECK(bench.map(label) == 2);
  CHECK(label == 12);
  CHECK(bench.held.counters().labelled == 1);
  CHECK(bench.held.counters().late == 1);
  CHECK(bench.held.counters().longest_ms / 10 == 54);  // less rounding
  CHECK(bench.held.empty());
}

TEST_CASE("where there is no room to wait the oldest goes; where nobody labels none waits") {
  Bench bench;
  int label = -1;
  bench.exchange.setLabeller(true);
  constexpr int kMost = static_cast<int>(LabelExchange::kPlaces);
  for (int n = 1; n <= 3 * kMost; ++n) {
    CHECK_FALSE(bench.held.full());
    bench.hold(n);
    CHECK(bench.map(label) == (n < kMost ? 0 : n - kMost + 1));
  }
  CHECK(bench.held.counters().no_room == 2 * kMost + 1);
  bench.exchange.setLabeller(false);
  for (int n = 2 * kMost + 2; n <= 3 * kMost; ++n) CHECK(bench.map(label) == n);
  CHECK(bench.held.counters().nobody == kMost - 1);
  CHECK(bench.held.empty());
}

TEST_CASE("a frame that has labels, or no images, waits for nothing") {
  Bench bench;
  int label = -1;
  bench.exchange.setLabeller(true);
  const Plain labels(7);
  SceneImages scene;
  scene.stamp = at(1);
  scene.labels = labels.view;
  bench.hold(1, scene);
  CHECK(bench.map(label) == 1);
  CHECK(label == 7);
  MapMessage message;
  message.frame = 2;
  bench.held.hold(message, nullptr, {}, bench.now);
  const HeldFrames::Frame* frame = bench.held.due(bench.now);
  REQUIRE(frame != nullptr);
  CHECK_FALSE(frame->has_images);
  bench.held.drop();
  CHECK_FALSE(bench.exchange.show([](Stamp, const ImageView&) { FAIL(); }));
}

/// Stands for a network: looks at what the map shows, answers `delay` seconds later; floods.
class Network {
 public:
  struct Behaviour {
    double delay = 0.3;  ///< s; negative: it never answers
    bool floods = false;
  };
  Network(LabelExchange& exchange, const Behaviour& behaviour)
      : exchange_(exchange), behaviour_(behaviour), thread_([this] { run(); }) {}
  ~Network() { end(); }
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;
  void end() {
    ended_.store(true);
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    std::deque<std::pair<double, Stamp>> questions;
    const Plain small(3, 100, 100);
    Plain answer(5, 0, 0);
    exchange_.setLabeller(true);
    for (std::int64_t n = 1; !ended_.load(); ++n) {
      const double now = wallSeconds();
      while (exchange_.show([&](Stamp stamp, const ImageView& image) {
        questions.emplace_back(now, stamp);
        if (answer.pixels.empty()) answer = Plain(5, image.width, image.height);
      })) {
      }
      exchange_.retryEarly();
      while (behaviour_.delay >= 0 && !questions.empty() &&
             now - questions.front().first >= behaviour_.delay) {
        exchange_.offer(questions.front().second, answer.view);
        questions.pop_front();
      }
      for (int i = 0; behaviour_.floods && i < 4; ++i) {
        const std::int64_t past = 1'000'000'000 + n, future = 4'000'000'000'000'000'000 + n;
        exchange_.offer({i % 2 == 0 ? past : future},
                        i < 2 || answer.pixels.empty() ? small.view : answer.view);
      }
      sleepFor(Duration::fromMilliseconds(2));
    }
  }

  LabelExchange& exchange_;
  Behaviour behaviour_;
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

TEST_CASE("the images of a frame that the front-end refuses do not wait for the map, nor push others out") {
  const auto source = openLog(shortLog());
  test::SilentListener listener;
  RunObserver observer(listener);
  Settings settings;
  settings.map.enabled = settings.map_stage.labels = true;
  const auto graph =
      std::make_unique<Graph>(source->rig(), source->imuNoise(), settings, observer, GraphOptions{});
  const CameraModel& camera = source->rig().camera[0];
  const Plain image(90, camera.width(), camera.height());
  const MapImagesIn& waiting = graph->map()->images;
  // A labelled frame at stamp n; the same stamp again is refused.
  const auto give = [&](int n) {
    SceneImages scene;
    scene.stamp = at(n);
    scene.labels = image.view;
    graph->sensors().takeScene(scene);
    StereoFrame frame;
    frame.stamp = at(n);
    frame.index = static_cast<std::uint64_t>(n);
    frame.image = {image.view, image.view};
    graph->track().frames.tell(frame);
    REQUIRE(graph->track().turn());
    graph->smooth().turn();
  };
  give(1);
  CHECK(waiting.size() == 1);
  for (int k = 0; k < 6; ++k) give(1);
  CHECK(waiting.size() == 1);
  CHECK(waiting.lost() == 0);
  give(2);
  CHECK(waiting.size() == 2);
}

struct Flown {
  RunStatistics statistics;
  LabelExchange::Counters labels;
  std::size_t vertices = 0, labelled = 0, wrong = 0;  ///< of the map's surface
};

/// The short log on threads, so many seconds of it, with a map and this network.
Flown fly(const Network::Behaviour& behaviour, Duration patience, double until) {
  const auto source = openLog(shortLog());
  test::SilentListener listener;
  RunObserver observer(listener);
  LogFeed feed(*source, {0, until, {}}, nullptr);
  Settings settings;
  settings.map.enabled = true;
  const CameraModel& camera = source->rig().camera[0];
  LabelExchange exchange(camera.width(), camera.height(), patience);
  Network network(exchange, behaviour);
  GraphOptions options;
  options.labels = &exchange;
  const auto graph = std::make_unique<Graph>(source->rig(), source->imuNoise(), settings, observer, options);
  LogPlayer player(feed, 1);
  const ThreadedReport report = runThreaded(player, *graph, ThreadedOptions{}, RunControl{});
  network.end();
  CHECK(report.faults.empty());
  REQUIRE(report.finished);
  graph->report(observer);
  struct Count : SurfaceSink {
    explicit Count(Flown& to) : flown(to) {}
    void take(const SurfacePatch& patch) override {
      for (const SurfaceVertex& vertex : patch.vertices) {
        ++flown.vertices;
        flown.labelled += vertex.label == 5 ? 1 : 0;
        flown.wrong += vertex.label != 5 && vertex.label != 0 ? 1 : 0;
      }
    }
    Flown& flown;
  };
  Flown flown{observer.statistics(), exchange.counters()};
  Count count(flown);
  graph->map()->stage().visitSurface(count);
  return flown;
}

// A map's images take minutes under a sanitizer.
TEST_CASE("labels that come 0.3 s after their image are in the map, amid a flood of others",
          "[unsanitized]") {
  const Flown flown = fly({0.3, true}, Duration::fromSeconds(1), 4);
  REQUIRE(flown.statistics.mapping);
  REQUIRE(flown.statistics.mapping->held);
  const MapThreadStatistics& map = *flown.statistics.mapping;
  CHECK(map.frames > 5);
  CHECK(map.without_image == 0);
  CHECK(map.held->labelled + map.held->late + map.held->no_room + map.held->nobody == map.frames);
  CHECK(map.held->labelled * 10 >= map.frames * 8);
  CHECK(map.held->longest_ms >= 300);
  CHECK(flown.labels.shown == map.frames);
  CHECK(flown.labels.taken == map.held->labelled);
  CHECK(flown.labels.wrong_size > 500);
  CHECK(flown.labels.unawaited > 500);
  CHECK(flown.vertices > 1000);
  CHECK(flown.labelled * 10 >= flown.vertices * 8);
  CHECK(flown.wrong == 0);
  CHECK(flown.statistics.frames_dropped == 0);
}

TEST_CASE("a network that never answers delays the map and costs it no frame", "[unsanitized]") {
  const Flown flown = fly({-1, false}, Duration::fromMilliseconds(300), 2.5);
  REQUIRE(flown.statistics.mapping);
  REQUIRE(flown.statistics.mapping->held);
  const MapThreadStatistics& map = *flown.statistics.mapping;
  CHECK(map.frames > 2);
  CHECK(map.without_image == 0);
  CHECK(map.held->late + map.held->no_room == map.frames);
  CHECK(flown.statistics.losses.at("map_frames_without_labels") == map.frames);
  CHECK(flown.vertices > 1000);
  CHECK(flown.labelled + flown.wrong == 0);
  CHECK(flown.statistics.frames_dropped == 0);
}

}  // namespace
}  // namespace swiftlet
