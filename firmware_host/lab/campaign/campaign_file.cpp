#include "firmware_host/lab/campaign/campaign_file.hpp"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "drivers/calibration/yaml_field.hpp"
#include "drivers/input/file_tree.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr int kMostRepeats = 190;  // frontend.max_features has this many values, two apart, in its range
constexpr int kMostSeeds = 100000;

int wholeNumber(const YamlField& field, int least, int most) {
  const double value = field.number();
  if (value != std::round(value) || value < least || value > most) {
    throw field.error(fmt::format("{:g} is not a whole number from {} to {}", value, least, most), "");
  }
  return static_cast<int>(value);
}

std::vector<std::string> texts(const YamlField& field) {
  if (!field.isList()) throw field.error("is not a list", "Write [--mono] or [--until, 60]");
  std::vector<std::string> all;
  for (const YamlField& item : field.items()) all.push_back(item.text());
  return all;
}

std::vector<std::string> textsAt(const YamlField& field, const char* key) {
  return field.has(key) ? texts(field.at(key)) : std::vector<std::string>{};
}

std::string nameOf(const YamlField& field, const std::string& name) {
  constexpr const char* kAllowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  if (name.empty() || name.front() == '.' || name.find_first_not_of(kAllowed) != std::string::npos) {
    throw field.error("`" + name + "` cannot name files",
                      "Give the log a `name` of letters, digits, hyphens, underscores and dots");
  }
  return name;
}

/// Sorted matches; the pattern itself if it has no wildcard.
std::vector<std::string> matches(const YamlField& field, const std::string& folder) {
  const std::string pattern = field.text();
  if (pattern.find_first_of("*?[") == std::string::npos) {
    if (!fs::exists(fs::path(folder) / pattern)) {
      throw field.error("`" + pattern + "` does not exist", "Paths are relative to this file");
    }
    return {pattern};
  }
  glob_t found{};
  std::vector<std::string> paths;
  if (glob((fs::path(folder) / pattern).c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) paths.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  if (paths.empty())
    throw field.error("`" + pattern + "` matches nothing", "Paths are relative to this file");
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// "a/b/" and "a/b.bag" both give b.
std::string stemOf(const std::string& path) {
  const fs::path whole = fs::path(path).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).stem();
}

void checkKeys(const YamlField& field, const std::vector<std::string>& known) {
  for (const std::string& key : field.keys()) {
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      throw field.at(key).error("is not known", fmt::format("Known here: {}", fmt::join(known, ", ")));
    }
  }
}

class Reader {
 public:
  explicit Reader(const std::string& file) { campaign_.folder = fs::absolute(file).parent_path(); }

  Campaign read(const YamlField& root) {
    checkKeys(root, {"repeats", "options", "logs"});
    if (root.has("repeats")) campaign_.repeats = wholeNumber(root.at("repeats"), 1, kMostRepeats);
    common_ = textsAt(root, "options");
    const YamlField logs = root.at("logs", "List the logs: logs: [path, path]");
    if (!logs.isList()) throw logs.error("is not a list", "Begin each log with a hyphen");
    for (const YamlField& item : logs.items()) {
      if (!item.isMap()) {
        addPaths(item, item);
      } else if (item.has("simulate")) {
        addSimulated(item);
      } else {
        checkKeys(item, {"path", "name", "truth", "options"});
        addPaths(item, item.at("path", "Give a path, or `simulate` for flights to be rendered"));
      }
    }
    if (campaign_.logs.empty()) throw logs.error("is empty", "List at least one log");
    return std::move(campaign_);
  }

 private:
  void addPaths(const YamlField& item, const YamlField& path) {
    const std::vector<std::string> found = matches(path, campaign_.folder);
    if (found.size() > 1 && item.isMap() && item.has("name")) {
      throw item.at("name").error(fmt::format("one name for {} logs", found.size()),
                                  "Omit it: each log has the name of its file");
    }
    for (const std::string& one : found) {
      CampaignLog log;
      log.path = one;
      if (item.isMap() && item.has("name")) {
        log.name = nameOf(item.at("name"), item.at("name").text());
      } else {
        log.name = nameOf(path, stemOf(one));
      }
      if (item.isMap() && item.has("truth")) {
        log.truth = fs::path(campaign_.folder) / item.at("truth").text();
      }
      add(item, std::move(log));
    }
  }

  void addSimulated(const YamlField& item) {
    checkKeys(item, {"simulate", "name", "seeds", "options"});
    const YamlField name = item.at("name", "Name the simulated flights");
    int first = 1;
    int last = 1;
    if (item.has("seeds")) {
      const std::vector<YamlField> seeds = item.at("seeds").items();
      if (seeds.size() != 2) throw item.at("seeds").error("is not the first and the last", "Write [1, 50]");
      first = wholeNumber(seeds[0], 0, kMostSeeds);
      last = wholeNumber(seeds[1], first, kMostSeeds);
    }
    for (int seed = first; seed <= last; ++seed) {
      CampaignLog log;
      log.name = nameOf(name, fmt::format("{}_{}", name.text(), seed));
      log.simulate = texts(item.at("simulate"));
      log.simulate.insert(log.simulate.end(), {"--seed", std::to_string(seed)});
      add(item, std::move(log));
    }
  }

  void add(const YamlField& item, CampaignLog log) {
    log.options = common_;
    if (item.isMap()) {
      for (std::string& option : textsAt(item, "options")) log.options.push_back(std::move(option));
    }
    const auto [before, is_new] = lines_.try_emplace(log.name, item.line());
    if (!is_new) {
      throw item.error(fmt::format("a second log named {}: line {} has one", log.name, before->second),
                       "Give it another `name`");
    }
    campaign_.logs.push_back(std::move(log));
  }

  Campaign campaign_;
  std::vector<std::string> common_;
  std::map<std::string, int> lines_;  ///< line of each name
};

}  // namespace

Campaign parseCampaign(const std::string& file, std::string_view text) {
  return Reader(file).read(YamlField::parse(file, text));
}

Campaign readCampaign(const std::string& file) { return parseCampaign(file, openFolder("")->text(file)); }

}  // namespace swiftlet
