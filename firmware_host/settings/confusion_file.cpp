#include "firmware_host/settings/confusion_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"

namespace swiftlet {
namespace {

constexpr double kSumTolerance = 0.01;
constexpr const char* kForm = "Write true,predicted,probability, for example 3,4,0.05";

/// The fields of one line; throws unless they are three numbers in range.
struct ConfusionLine {
  ConfusionLine(const std::string& path, int number, std::string_view line) {
    const std::array<const char*, 3> names{"true", "said", "probability"};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::size_t comma = std::min(line.find(','), line.size());
      const std::string_view field = line.substr(0, comma);
      double value = 0;
      const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
      const bool is_label = i < 2;
      const bool in_range = is_label ? value >= 1 && value < kLabelValues && value == std::floor(value)
                                     : value >= 0 && value <= 1;
      const bool is_last = i + 1 == names.size();
      if (error != std::errc() || end != field.data() + field.size() || !in_range ||
          is_last != (comma == line.size())) {
        throw InputError(
            path, number, names[i],
            fmt::format("\"{}\" is not a {}", field, is_label ? "label from 1 to 31" : "probability"), kForm);
      }
      value_[i] = value;
      line.remove_prefix(std::min(comma + 1, line.size()));
    }
  }
  [[nodiscard]] std::size_t real() const { return static_cast<std::size_t>(value_[0]); }
  [[nodiscard]] std::size_t said() const { return static_cast<std::size_t>(value_[1]); }
  [[nodiscard]] double probability() const { return value_[2]; }

 private:
  std::array<double, 3> value_{};
};

}  // namespace

ConfusionModel readConfusion(const std::string& path, float right) {
  std::istringstream file(readFile(path, "Set map.confusion to a readable file, or leave it empty"));
  ConfusionModel::Matrix matrix{};
  std::array<double, kLabelValues> sum{};
  std::array<int, kLabelValues> first_line{};
  std::array<std::array<bool, kLabelValues>, kLabelValues> given{};
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    if (!text.empty() && text.back() == '\r') text.pop_back();
    if (text.empty() || text.front() == '#') continue;
    const ConfusionLine line(path, number, text);
    if (given[line.said()][line.real()]) {
      throw InputError(path, number, "said",
                       fmt::format("this pair of labels appears twice (true label {})", line.real()), kForm);
    }
    given[line.said()][line.real()] = true;
    matrix[line.said()][line.real()] = static_cast<float>(line.probability());
    sum[line.real()] += line.probability();
    if (first_line[line.real()] == 0) first_line[line.real()] = number;
  }
  for (std::size_t real = 1; real < kLabelValues; ++real) {
    if (first_line[real] == 0) {
      for (std::size_t said = 1; said < kLabelValues; ++said) {
        matrix[said][real] = said == real ? right : (1 - right) / (kLabelValues - 2);
      }
    } else if (std::abs(sum[real] - 1) > kSumTolerance) {
      throw InputError(path, first_line[real], "probability",
                       fmt::format("the probabilities of true label {} sum to {:g}", real, sum[real]),
                       "Make the probabilities of each true label sum to 1");
    }
  }
  ConfusionModel model;
  if (const Status status = model.set(matrix, kLabelValues); !status.ok()) {
    throw InputError(path, 0, "", status.what, kForm);
  }
  return model;
}

std::optional<ConfusionModel> confusionOf(const Settings& settings) {
  if (settings.map.confusion.empty()) return std::nullopt;
  return readConfusion(settings.map.confusion, static_cast<float>(settings.map_stage.label_certainty));
}

}  // namespace swiftlet
