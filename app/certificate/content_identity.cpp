// Who, what, where, when and how: ISO/IEC 17025:2017, 7.8.2.1 a) to k).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/content.h"
#include "app/certificate/rounding.h"
#include "app/certificate/scalar_results.h"

namespace plumbline::app::content {
namespace {

std::string joined(const std::string& first, const std::string& second) {
  return first.empty() || second.empty() ? first + second : first + ", " + second;
}

std::string contact(const Address& address) {
  std::string text = joined(address.name, address.place());
  text = joined(text, address.email);
  return joined(text, address.phone);
}

std::string period(const PerformanceDates& dates) {
  return dates.from == dates.to ? dates.from : dates.from + " – " + dates.to;
}

std::string source_text(const Composer& c, const TraceabilitySource& source) {
  if (source.certificate.empty()) return source.statement;
  return joined(source.statement, c.tr("certificate {}", source.certificate));
}

std::string temperature_range(const Calibration& calibration) {
  double low = INFINITY, high = -INFINITY;
  for (const PoseResult& pose : calibration.pose_results) {
    if (!std::isfinite(pose.temp_C)) continue;
    low = std::min(low, pose.temp_C);
    high = std::max(high, pose.temp_C);
  }
  return low <= high ? fmt::format("{:.1f} °C – {:.1f} °C", low, high) : "";
}

std::string location_text(const Composer& c) {
  const std::string& place = c.input.laboratory.location;
  if (place == "laboratory") return c.tr("in the laboratory");
  if (place == "customer") return c.tr("at the customer's");
  if (place == "laboratoryBranch") return c.tr("in a branch of the laboratory");
  if (place == "customerBranch") return c.tr("in a branch of the customer");
  if (place.empty()) return "";
  return c.tr("elsewhere");
}

std::string gravity_text(const Composer& c) {
  const auto& gravity = c.input.description.gravity;
  if (!(gravity.u_mps2 > 0)) {
    return c.tr("g = {} m/s²; uncertainty not stated", significant(gravity.local_mps2, 7));
  }
  return fmt::format("g = {}, k = 2",
                     result_with_unit(gravity.local_mps2, 2 * gravity.u_mps2, "m/s²"));
}

}  // namespace

void add_identification(const Composer& c) {
  const RunDescription& run = c.input.description;
  const Laboratory& lab = c.input.laboratory;
  c.add(Heading{c.tr("Item, customer and laboratory")});
  Facts facts;
  facts.rows = {
      {c.tr("Number of the certificate"), joined(lab.number, c.document.id)},
      {c.tr("Laboratory"), contact(lab.laboratory)},
      {c.tr("Accreditation"), lab.accreditation},
      {c.tr("Place of calibration"), location_text(c)},
      {c.tr("Customer"), contact(lab.customer)},
      {c.tr("Customer's order"), lab.order},
      {c.tr("Item"), run.dut.model.empty() ? c.tr("accelerometer triad") : run.dut.model},
      {c.tr("Manufacturer"), lab.manufacturer},
      {c.tr("Serial number"), run.dut.serial},
      {c.tr("Customer's number of the item"), lab.customer_item},
      {c.tr("Condition of the item"), lab.item_condition},
      {c.tr("Received"), lab.received},
      {c.tr("Measured"), period(performance_dates(c.input))},
      {c.tr("Issued"), c.input.provenance.created_utc},
      {c.tr("Authorised by"), joined(lab.authorised_by, lab.authorised_role)},
  };
  c.add(std::move(facts));
}

void add_method(const Composer& c) {
  const RunDescription& run = c.input.description;
  const Laboratory& lab = c.input.laboratory;
  const Calibration& calibration = c.input.calibration;
  const bool scalar = c.input.scalar != nullptr;
  c.add(Heading{c.tr("Method and conditions")});
  Facts facts;
  facts.rows = {
      {c.tr("Method"),
       scalar ? scalar_method(c)
              : c.tr("multipoint tumble test in the field of gravity on a two-axis dividing head, "
                     "{} positions, {} readings; estimated by weighted least squares, recursive "
                     "least squares and an eight-state Kalman filter",
                     calibration.poses, calibration.samples)},
      {c.tr("Procedure"), lab.procedure},
      {c.tr("Deviations from the procedure"), lab.deviations},
  };
  if (!scalar)
    facts.rows.emplace_back(c.tr("Traceability of the angles"), source_text(c, lab.head));
  facts.rows.emplace_back(c.tr("Traceability of gravity"), source_text(c, lab.gravity));
  facts.rows.emplace_back(c.tr("Local gravity"), gravity_text(c));
  if (scalar) {
    facts.rows.emplace_back(c.tr("Rests"), c.tr.phrase(c.input.scalar->source.rests));
  } else {
    facts.rows.insert(
        facts.rows.end(),
        {{c.tr("Positioning of the head"),
          run.angles.delta_arcsec > 0 || run.angles.h_arcsec > 0
              ? c.tr("standard uncertainty {}″ in δ and {}″ in h",
                     significant(run.angles.delta_arcsec, 3), significant(run.angles.h_arcsec, 3))
              : ""},
         {c.tr("Converter"),
          run.adc ? c.tr("{} bits from {} V to {} V, step {} µV", run.adc->bits,
                         significant(run.adc->min_V, 4), significant(run.adc->max_V, 4),
                         significant(1e6 * run.adc->lsb_V(), 4))
                  : c.tr("not described; nothing is assumed about quantization")},
         {c.tr("Reference temperature"), fmt::format("{} °C", significant(run.reference_C, 3))},
         {c.tr("Temperature during the run"), temperature_range(calibration)}});
  }
  facts.rows.emplace_back(c.tr("Conditions in the room"), lab.ambient);
  c.add(std::move(facts));
}

}  // namespace plumbline::app::content
