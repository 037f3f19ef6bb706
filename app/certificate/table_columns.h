// How wide the columns of a table are, and to which side their cells lean.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/certificate/document.h"

namespace plumbline::app {

/// Words to the left, numbers to the right.
Anchor column_anchor(const Table& table, std::size_t column);

/// Further room to the left of words that follow numbers, which would else touch them.
double column_indent(const Table& table, std::size_t column);

/// Widths that sum to `total`. Columns keep what their widest cell needs while there is room; where
/// there is not, those that can wrap share what is left, and in the last resort words are broken.
/// `text_width(text, bold)` is the width of a text in one line.
std::vector<double> column_widths(
    const Table& table, double total,
    const std::function<double(const std::string& text, bool bold)>& text_width);

}  // namespace plumbline::app
