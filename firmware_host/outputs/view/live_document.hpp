#pragma once
// Content of the live view, as the report's document (docs/report.md) and patches that extend it
// (docs/view.md), made from the newest values of a LiveOutlet.
//
// Call sample() some twenty times a second and patch() a few times. document() is the state after the last
// patch. One thread. Memory: bounded (LiveTable, and the limits below), whatever the run's length.

#include <cstdint>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware_host/interfaces/live_outlet.hpp"
#include "firmware_host/outputs/view/live_table.hpp"
#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {

class LiveDocument {
 public:
  static constexpr std::size_t kMostEvents = 300;
  static constexpr std::size_t kMostSpans = 100;          ///< spans of health
  static constexpr std::size_t kMostCloudPoints = 40000;  ///< points of the map; more are thinned evenly

  /// `cameras`: for the document's run (image_panel.js); empty: no images are shown.
  explicit LiveDocument(std::string name, nlohmann::ordered_json cameras = nlohmann::ordered_json::array());

  /// Takes new values. `now`: the host's clock [s]. `watched`: there are viewers, so that surfaces are worth
  /// computing.
  void sample(LiveOutlet& outlet, double now, bool watched);
  /// Changes since the last patch; patches are numbered from 1.
  nlohmann::ordered_json patch();
  [[nodiscard]] nlohmann::ordered_json document() const;
  /// The newest figures as lines of text.
  [[nodiscard]] std::string text() const;
  /// Time on the page's axis [s]. Before the first frame, sets the origin.
  [[nodiscard]] double timeOf(Stamp stamp) {
    begin(stamp);
    return seconds(stamp);
  }
  /// Counters of the view itself, for the summary shown.
  void setViewers(const nlohmann::ordered_json& counters) { viewers_ = counters; }

 private:
  using Json = nlohmann::ordered_json;
  struct Line {
    const char* name;
    std::size_t column;
  };
  struct PlotPlan {
    const char* id;
    const char* group;
    const char* title;
    const char* y_label;
    const LiveTable* table;
    std::vector<Line> lines;
    /// For a plan view: column of x; otherwise the time's.
    std::size_t x = 0;
  };

  [[nodiscard]] double seconds(Stamp stamp) const { return (stamp - first_).seconds(); }
  void begin(Stamp stamp);
  void takeFrame(LiveOutlet& outlet);
  void takeState(LiveOutlet& outlet, double now);
  void takeHealth(double t, Health health, std::uint32_t epoch);
  void takeVerdict(LiveOutlet& outlet, double now);
  void noteTroubles(const Verdict& verdict);
  void takeMesh(LiveOutlet& outlet);
  void takeSurface(LiveOutlet& outlet, double now);
  void takeObstacle(LiveOutlet& outlet);
  void note(double t, const char* name, std::string text);
  [[nodiscard]] Json plotJson(const PlotPlan& plan, bool whole) const;
  [[nodiscard]] Json trajectoryJson(bool whole) const;
  [[nodiscard]] Json healthJson() const;
  [[nodiscard]] Json liveJson() const;
  [[nodiscard]] Json tablesJson() const;
  [[nodiscard]] Json poseJson() const;

  std::string name_;
  Json cameras_;
  LiveTable states_, frames_, state_intervals_, frame_intervals_, latencies_, obstacles_;
  std::vector<PlotPlan> plans_;
  bool begun_ = false;
  Stamp first_;
  double duration_ = 0;
  std::uint64_t sequence_ = 0;

  std::uint64_t frame_number_ = 0, state_number_ = 0, mesh_number_ = 0, surface_number_ = 0,
                obstacle_number_ = 0;
  std::optional<FrameNews> frame_;
  std::optional<NavState> state_;
  double now_ = 0, state_came_ = 0, mesh_came_ = -1e9, surface_asked_ = -1e9;
  LatencyHistogram latency_;

  std::deque<Json> spans_;
  bool spans_changed_ = false;
  std::deque<Json> events_;
  std::size_t unsent_events_ = 0;
  std::optional<Verdict> verdict_;
  bool supervised_ = true;  ///< the verdict is not stale
  std::string waiting_for_;
  Json mesh_, cloud_;  ///< null: none so far
  bool mesh_changed_ = false, cloud_changed_ = false;
  Json viewers_;
  int patches_to_tables_ = 0;
};

}  // namespace swiftlet
