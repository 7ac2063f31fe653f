#pragma once
// The confusion matrix of a map's labels as a picture (SVG): a row for each true class that holds at least
// kLeastShare of the places, a column for each of these found, one for every other label and one for none.
// A cell's shade and number are the share of its row. Host side.

#include <map>
#include <string>

#include "firmware_host/lab/evaluation/label_confusion.hpp"

namespace swiftlet {

/// Names by label, of a log's labels.csv (`#id,name`, then a line each). Empty if there is no such file;
/// InputError with the line where one is not of that form.
std::map<int, std::string> readLabelNames(const std::string& log);

/// Labels without a name are shown by number.
std::string confusionSvg(const LabelConfusion& labels, const std::map<int, std::string>& names);

}  // namespace swiftlet
