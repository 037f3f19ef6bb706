// The effects in words, and what their parameters are called.
#pragma once

#include <string>
#include <vector>

#include "app/certificate/language.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// "second-order nonlinearity" for "sensor.quadratic"; sums ("a+b") member by member; the id itself
/// for what has no words.
std::string effect_name(const std::string& id, const Translator& tr);

/// The ids of which a sum ("a+b") consists.
std::vector<std::string> members_of(const std::string& id);

/// "x, z"
std::string axes_text(const std::vector<std::size_t>& axes);

/// "k2 (x) = (0.01230 ± 0.00040) g/g²": value and expanded uncertainty (k = 2).
std::string parameter_text(const EffectParameter& parameter);

/// "g/g²" for "g/g^2": units as they are printed.
std::string printed_unit(std::string unit);

/// What stands between a value and its printed unit: nothing before ° and where there is none.
std::string before_unit(const std::string& unit);

/// At most `most` characters; a picture cannot wrap.
std::string shortened(const std::string& text, std::size_t most);

/// The term of an effect as a formula with its parameters ("k2·a_i²"), members of a sum one by one;
/// empty for what has none.
std::string effect_term(const std::string& id, const Translator& tr);

/// The structure that no listed effect explains, in words.
std::string unlisted_name(const UnlistedStructure& found, const Translator& tr);

}  // namespace plumbline::app
