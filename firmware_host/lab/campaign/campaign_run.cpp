#include "firmware_host/lab/campaign/campaign_run.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>
#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/campaign/child_process.hpp"
#include "firmware_host/lab/evaluation/evaluate_run.hpp"
#include "firmware_host/outputs/run_folder/summary.hpp"
#include "firmware_host/settings/registry.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kFeatures = "frontend.max_features";
constexpr int kFeaturesPerRepeat = 2;  // of 300: 292 to 306 in eight repeats, as in docs/accuracy.md

std::string textOf(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// The line of a program's output that states the error, or the last line. For a refused option it precedes a
/// hint at --help.
std::string complaint(const fs::path& output) {
  std::ifstream file(output);
  std::string said;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("error: ")) return line.substr(std::strlen("error: "));
    if (!line.empty() && !line.starts_with("Run with --help")) said = line;
  }
  return said;
}

std::string saysOf(const ChildEnd& end, const fs::path& output) {
  if (end.errno_of_start != 0) return std::strerror(end.errno_of_start);
  if (end.signal != 0) return fmt::format("ended by signal {} ({})", end.signal, strsignal(end.signal));
  if (end.exit_code == 0) return "";
  const std::string said = complaint(output);
  return said.empty() ? fmt::format("exit code {}", end.exit_code) : said;
}

/// Changes `features` by steps alternately down and up; if one direction leaves the range, only in the other.
int changedFeatures(int features, int repeat) {
  const auto& range = std::get<IntegerSetting>(findSetting(kFeatures)->kind);
  const int down = (features - range.low) / kFeaturesPerRepeat;
  const int up = (range.high - features) / kFeaturesPerRepeat;
  const int in_turn = 2 * std::min(down, up);
  const bool lower = repeat > in_turn ? down > up : repeat % 2 == 1;
  const int steps = repeat > in_turn ? repeat - in_turn / 2 : (repeat + 1) / 2;
  return features + (lower ? -steps : steps) * kFeaturesPerRepeat;
}

class Job {
 public:
  Job(const Campaign& campaign, const CampaignRequest& request, const CampaignLog& log,
      const std::atomic<bool>& stop)
      : campaign_(campaign), request_(request), log_(log), stop_(stop), out_(fs::absolute(request.out)) {}

  bool run() {
    std::vector<int> missing;
    for (int repeat = 0; repeat < campaign_.repeats; ++repeat) {
      if (!isDone(repeat)) missing.push_back(repeat);
    }
    if (missing.empty()) return true;
    for (const char* folder : {"rows", "runs", "logs"}) fs::create_directories(out_ / folder);
    const std::string no_log = log_.path.empty() ? render() : "";
    bool whole = true;
    for (const int repeat : missing) {
      whole = no_log.empty() ? replay(repeat) : refuse(repeat, "simulate: " + no_log);
      if (!whole) break;
    }
    if (log_.path.empty()) removeRendered();
    return whole;
  }

  [[nodiscard]] std::vector<std::string> command(int repeat) const {
    std::vector<std::string> words = {"replay", log_.path.empty() ? log_.name : log_.path};
    words.insert(words.end(), log_.options.begin(), log_.options.end());
    if (!log_.truth.empty()) words.insert(words.end(), {"truth:", log_.truth});
    if (log_.path.empty()) {
      words.emplace_back("of simulate");
      words.insert(words.end(), log_.simulate.begin(), log_.simulate.end());
    }
    if (repeat > 0) words.push_back(fmt::format("repeat {}", repeat));
    return words;
  }

 private:
  [[nodiscard]] std::string rowFile(int repeat) const { return campaignRowFile(out_, log_.name, repeat); }
  [[nodiscard]] fs::path runFolder(int repeat) const {
    return out_ / "runs" / fmt::format("{}.{}", log_.name, repeat);
  }
  [[nodiscard]] fs::path rendered() const { return out_ / "logs" / log_.name; }

  [[nodiscard]] bool isDone(int repeat) const {
    return fs::exists(rowFile(repeat)) &&
           readCampaignRow(rowFile(repeat)).outcome != CampaignOutcome::kAborted;
  }

  void removeRendered() const {
    std::error_code ignored;
    fs::remove_all(rendered(), ignored);
  }

  /// Renders a log. Returns why there is none; empty: there is, or it was stopped.
  std::string render() {
    removeRendered();  // left by a campaign that was killed
    std::vector<std::string> words = {request_.program, "simulate", "--out", rendered()};
    words.insert(words.end(), log_.simulate.begin(), log_.simulate.end());
    const fs::path output = rendered().string() + ".txt";
    const ChildEnd end = runChild(words, campaign_.folder, output, stop_);
    const std::string says = saysOf(end, output);
    if (says.empty()) fs::remove(output);
    return stop_ ? "" : says;
  }

  [[nodiscard]] CampaignRow emptyRow(int repeat) const {
    CampaignRow row;
    row.log = log_.name;
    row.repeat = repeat;
    row.command = command(repeat);
    row.program = request_.version;
    return row;
  }

  bool refuse(int repeat, const std::string& says) const {
    CampaignRow row = emptyRow(repeat);
    row.says = says;
    write(row);
    return true;
  }

  [[nodiscard]] fs::path firstSettings() const { return runFolder(0) / "settings.yaml"; }

  /// The setting that distinguishes repeats above 0.
  [[nodiscard]] std::string changedSetting(int repeat) const {
    const YAML::Node features = YAML::LoadFile(firstSettings())["frontend"]["max_features"];
    return fmt::format("{}={}", kFeatures, changedFeatures(features.as<int>(), repeat));
  }

  bool replay(int repeat) const {
    if (repeat > 0 && !fs::exists(firstSettings())) return refuse(repeat, "repeat 0 left no settings");
    std::vector<std::string> words = {request_.program, "replay",
                                      log_.path.empty() ? rendered().string() : log_.path, "--out",
                                      runFolder(repeat)};
    words.insert(words.end(), log_.options.begin(), log_.options.end());
    if (repeat > 0) words.insert(words.end(), {"--set", changedSetting(repeat)});
    const fs::path output = runFolder(repeat).string() + ".txt";
    const ChildEnd end = runChild(words, campaign_.folder, output, stop_);
    if (stop_) return false;
    CampaignRow row = emptyRow(repeat);
    row.says = saysOf(end, output);
    const Json summary = Json::parse(textOf(runFolder(repeat) / "summary.json"), nullptr, false);
    const bool to_its_end = (end.exit_code == 0 || end.exit_code == 1) && summary.is_object() &&
                            summary.value("/run/finished"_json_pointer, false);
    if (to_its_end) {
      row.outcome = end.exit_code == 0 ? CampaignOutcome::kDone : CampaignOutcome::kFailed;
      row.costs = figuresOf(summary, costFigures());
      addAccuracy(repeat, summary, row);
    }
    write(row);
    return true;
  }

  void addAccuracy(int repeat, Json summary, CampaignRow& row) const {
    if (!log_.truth.empty() && summary["run"]["first_pose_ns"].is_number()) {
      try {
        const Truth truth = readTruth(log_.truth);
        const Trajectory poses = onImageClock(truth.poses, cameraToImuShift(summary));
        summary["accuracy"] = runAccuracyJson(runFolder(repeat), poses, truth.name,
                                              Stamp{summary["run"]["first_image_ns"].get<std::int64_t>()},
                                              Settings{}.evaluation);
      } catch (const std::exception& error) {
        row.outcome = CampaignOutcome::kAborted;
        row.says = error.what();
      }
    }
    row.accuracy = figuresOf(summary, accuracyFigures());
  }

  void write(const CampaignRow& row) const {
    writeWholeFile(rowFile(row.repeat), toJson(row).dump(2) + "\n");
  }

  const Campaign& campaign_;
  const CampaignRequest& request_;
  const CampaignLog& log_;
  const std::atomic<bool>& stop_;
  fs::path out_;
};

const std::atomic<bool> kNeverStopped{false};

}  // namespace

std::string programVersion(const std::string& program) {
  const std::string output = fs::temp_directory_path() / fmt::format("swiftlet_version_{}", getpid());
  const ChildEnd end = runChild({program, "--version"}, "/", output, kNeverStopped);
  const std::string said = textOf(output);
  const std::string says = saysOf(end, output);
  fs::remove(output);
  if (end.exit_code != 0 || said.empty()) {
    throw InputError(program, 0, "", "does not run: " + says, "Give a swiftlet as --program");
  }
  const std::string bytes = textOf(program);
  const auto sum = crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  return fmt::format("{} crc32 {:08x}", said.substr(0, said.find('\n')), sum);
}

std::vector<CampaignRow> storedRows(const Campaign& campaign, const std::string& out) {
  std::vector<CampaignRow> rows;
  for (const CampaignLog& log : campaign.logs) {
    for (int repeat = 0; repeat < campaign.repeats; ++repeat) {
      const std::string file = campaignRowFile(out, log.name, repeat);
      if (fs::exists(file)) rows.push_back(readCampaignRow(file));
    }
  }
  return rows;
}

std::vector<CampaignRow> campaignRows(const Campaign& campaign, const CampaignRequest& request) {
  constexpr const char* kRemedy = "Give another --out folder, and this one with --beside to compare both";
  std::vector<CampaignRow> rows = storedRows(campaign, request.out);
  for (const CampaignRow& row : rows) {
    const std::string file = campaignRowFile(request.out, row.log, row.repeat);
    if (row.program != request.version) {
      throw InputError(file, 0, "program", "was run by " + row.program + ", not by " + request.version,
                       kRemedy);
    }
    const auto log = std::find_if(campaign.logs.begin(), campaign.logs.end(),
                                  [&row](const CampaignLog& one) { return one.name == row.log; });
    if (log == campaign.logs.end() ||
        row.command != Job(campaign, request, *log, kNeverStopped).command(row.repeat)) {
      throw InputError(file, 0, "command", "was run with other options", kRemedy);
    }
  }
  return rows;
}

bool runCampaignJob(const Campaign& campaign, const CampaignRequest& request, const CampaignLog& log,
                    const std::atomic<bool>& stop) {
  return Job(campaign, request, log, stop).run();
}

bool runCampaign(const Campaign& campaign, const CampaignRequest& request, const std::atomic<bool>& stop,
                 const std::function<void(const CampaignLog& log)>& ended) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> end{false};
  std::exception_ptr error;
  std::mutex mutex;
  const auto work = [&] {
    while (!end) {
      const std::size_t i = next++;
      if (i >= campaign.logs.size()) return;
      try {
        if (!runCampaignJob(campaign, request, campaign.logs[i], stop)) end = true;
        const std::lock_guard lock(mutex);
        if (!end) ended(campaign.logs[i]);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!error) error = std::current_exception();
        end = true;
      }
    }
  };
  std::vector<std::thread> workers;
  for (int i = 0; i < request.jobs; ++i) workers.emplace_back(work);
  for (std::thread& worker : workers) worker.join();
  if (error) std::rethrow_exception(error);
  return !end;
}

}  // namespace swiftlet
