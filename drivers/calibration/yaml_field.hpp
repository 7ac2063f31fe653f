#pragma once
// One value of a YAML file with its location, so that every message names file, line and field. Used by the
// readers of drivers/calibration and drivers/target, and of a campaign's lists of logs.

#include <yaml-cpp/yaml.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/input/input_error.hpp"

namespace swiftlet {

class YamlField {
 public:
  /// Parses a document whose root must be a map. OpenCV's "%YAML:1.0" line is accepted.
  static YamlField parse(const std::string& file, std::string_view text);

  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] bool isMap() const { return node_.IsMap(); }
  [[nodiscard]] bool isList() const { return node_.IsSequence(); }
  /// The value under `key`; InputError when absent.
  [[nodiscard]] YamlField at(const std::string& key, const std::string& remedy = {}) const;
  [[nodiscard]] std::vector<YamlField> items() const;
  /// Keys of a map; empty for other values.
  [[nodiscard]] std::vector<std::string> keys() const;

  [[nodiscard]] std::string text() const;
  [[nodiscard]] double number() const;
  [[nodiscard]] std::vector<double> numbers() const;

  [[nodiscard]] const std::string& file() const { return *file_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] int line() const { return line_; }
  /// An error at this field.
  [[nodiscard]] InputError error(const std::string& message, const std::string& remedy) const;
  /// "file:line: field", for warnings.
  [[nodiscard]] std::string where() const { return place().where(); }
  [[nodiscard]] InputPlace place() const { return {*file_, line_, name_}; }

 private:
  YamlField(std::shared_ptr<const std::string> file, std::string name, const YAML::Node& node, int line)
      : file_(std::move(file)), name_(std::move(name)), node_(node), line_(line) {}

  std::shared_ptr<const std::string> file_;
  std::string name_;  ///< dotted path from the root
  YAML::Node node_;
  int line_ = 0;  ///< of the key or the list item
};

}  // namespace swiftlet
