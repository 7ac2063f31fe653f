#include "drivers/dds/topic_search.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace swiftlet {
namespace {

/// Number of letters to insert, delete or replace (Levenshtein).
std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({replaced, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

}  // namespace

std::string missingTopic(std::span<const PublishedTopic> published, std::string_view type,
                         std::string_view name) {
  constexpr std::size_t kMost = 3;
  std::vector<std::pair<std::size_t, std::string_view>> near;
  for (const PublishedTopic& topic : published) {
    if (topic.name == name) {
      return std::string(name) + " is a " + topic.type + ", expected a " + std::string(type);
    }
    if (topic.type == type) near.emplace_back(editDistance(topic.name, name), topic.name);
  }
  std::ranges::sort(near);
  std::string text = "no publisher of " + std::string(type) + " on " + std::string(name);
  if (near.empty()) return text + ", nor on any other topic";
  text += "; near: ";
  for (std::size_t i = 0; i < std::min(kMost, near.size()); ++i) {
    text += (i > 0 ? ", " : "") + std::string(near[i].second);
  }
  return text;
}

}  // namespace swiftlet
