#pragma once
// The confusion matrix of a map's labels as a picture (SVG). One row for each true class with at least
// kLeastShare of the places; one column for each of these classes, one for all other labels and one for no
// label. A cell's shade and number are its share of the row. Host side.

#include <map>
#include <string>

#include "firmware_host/lab/evaluation/label_confusion.hpp"

namespace swiftlet {

/// Names by label, from a log's labels.csv (`#id,name`, then one label per line). Empty if there is no such
/// file; InputError naming the line if it is malformed.
std::map<int, std::string> readLabelNames(const std::string& log);

/// Labels without a name are shown by number.
std::string confusionSvg(const LabelConfusion& labels, const std::map<int, std::string>& names);

}  // namespace swiftlet
