#include "app/certificate/content.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "app/certificate/effect_words.h"
#include "app/certificate/figures.h"
#include "app/certificate/fingerprint.h"
#include "app/certificate/rounding.h"
#include "estimator/decision.h"

namespace plumbline::app {

namespace content {

std::size_t Composer::figures() const {
  return static_cast<std::size_t>(
      std::count_if(document.blocks.begin(), document.blocks.end(),
                    [](const Block& block) { return std::holds_alternative<Figure>(block); }));
}

void Composer::add(Block block) const {
  if (auto* figure = std::get_if<Figure>(&block)) {
    figure->caption = tr("Figure {}. {}", figures() + 1, figure->caption);
  }
  document.blocks.push_back(std::move(block));
}

std::string milli_mps2(double value_mps2) { return significant(1e3 * value_mps2, 3); }

std::string sentence(std::string text) {
  if (text.empty()) return text;
  const std::size_t word = text.find(' ');
  if (text.substr(0, word).find('.') == std::string::npos) {
    text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
    // Cyrillic а to п, the letters that our sentences begin with.
    if (text.size() > 1 && text[0] == '\xd0' && text[1] >= '\xb0' && text[1] <= '\xbf') {
      text[1] = static_cast<char>(text[1] - 0x20);
    }
  }
  if (text.back() != '.') text += '.';
  return text;
}

namespace {

bool out_of_limits(const Decision& decision) {
  return decision.status == DecisionStatus::fail ||
         decision.status == DecisionStatus::conditional_fail;
}

bool suspicious(Verdict verdict) {
  return verdict == Verdict::unexplained || verdict == Verdict::partly_explained;
}

std::string headline(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  const DecisionStatus status = stated_decision(calibration.decision, c.input.events).status;
  if (is_unfinished(c.input.events)) {
    return status == DecisionStatus::none ? c.tr("Run not finished")
                                          : c.tr("Run not finished: {}", c.tr(to_words(status)));
  }
  if (status != DecisionStatus::none) return c.tr(to_words(status));
  if (suspicious(calibration.diagnosis.verdict)) return c.tr("Calibrated, residual too large");
  return c.input.scalar != nullptr ? c.tr("Calibrated without angles") : c.tr("Calibrated");
}

/// What was found, in a sentence that needs no symbols.
std::string finding(const Composer& c) {
  const Diagnosis& diagnosis = c.input.calibration.diagnosis;
  std::string names;
  for (const FoundEffect& effect : diagnosis.effects) {
    names += (names.empty() ? "" : "; ") + effect_name(effect.id, c.tr) + " (" +
             axes_text(effect.axes) + ")";
  }
  for (const UnlistedStructure& unlisted : diagnosis.unlisted) {
    names += (names.empty() ? "" : "; ") + unlisted_name(unlisted, c.tr) + " (" +
             axes_text(unlisted.axes) + ")";
  }
  const bool nine = c.input.scalar != nullptr;
  switch (diagnosis.verdict) {
    case Verdict::clean:
      return nine
                 ? c.tr("The nine parameters describe the unit; nothing stands out of the noise.")
                 : c.tr(
                       "The twelve parameters describe the unit; nothing stands out of the noise.");
    case Verdict::explained:
    case Verdict::partly_explained: {
      if (!diagnosis.enlarges_model())
        return c.tr("The twelve parameters describe the unit. Beside them: {}.", names);
      const std::string added =
          nine
              ? c.tr("The nine parameters alone do not describe the unit. Added to the model: {}.",
                     names)
              : c.tr(
                    "The twelve parameters alone do not describe the unit. Added to the model: {}.",
                    names);
      return diagnosis.verdict == Verdict::explained
                 ? added
                 : added + " " + c.tr("Something remains that this does not explain.");
    }
    case Verdict::unexplained:
      return c.tr("The model lacks something that could not be traced.");
    case Verdict::undetermined:
      break;
  }
  return c.tr("The data are too few to tell whether the model is complete.");
}

std::string error_sentence(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  const PerAxis<double>& error = calibration.before.heldout_pose_rms_mps2;
  // One axis throughout: the one that stood out most before anything was added.
  const std::size_t axis = axis_standing_out(error, calibration.floor_pose_rms_mps2);
  const double floor = calibration.floor_pose_rms_mps2[axis];
  const double after = calibration.after.heldout_pose_rms_mps2[axis];
  if (!calibration.diagnosis.enlarges_model()) {
    return c.tr(
        "Error of a pose that took no part in the fit: {} mm/s² RMS on the {} axis, where the "
        "noise alone would leave {} mm/s².",
        milli_mps2(after), kAxisName[axis], milli_mps2(floor));
  }
  return c.tr(
      "Error of a pose that took no part in the fit, {} axis: {} mm/s² RMS before, {} mm/s² "
      "after the added effects; the noise alone would leave {} mm/s².",
      kAxisName[axis], milli_mps2(error[axis]), milli_mps2(after), milli_mps2(floor));
}

void add_summary(const Composer& c) {
  Document& document = c.document;
  const Calibration& calibration = c.input.calibration;
  document.tone = out_of_limits(calibration.decision) || suspicious(calibration.diagnosis.verdict)
                      ? Tone::warning
                      : Tone::plain;
  document.headline = headline(c);
  for (const CertificateEvent& event : c.input.events) {
    if (event.kind != kIncomplete) continue;
    document.tone = Tone::warning;
    document.summary.push_back(sentence(c.tr.phrase(event.text)));
  }
  document.summary.push_back(finding(c));
  document.summary.push_back(c.input.scalar != nullptr ? scalar_error_sentence(c)
                                                       : error_sentence(c));
  if (const Evaluation* fresh = c.input.verification; fresh != nullptr) {
    if (const auto axis = contradicted_axis(calibration, *fresh)) {
      document.tone = Tone::warning;
      document.summary.push_back(c.tr(
          "The fresh verification poses do not confirm the model: {} mm/s² RMS on the {} axis, "
          "where the noise alone would leave {} mm/s².",
          milli_mps2(fresh->after.pose_rms_mps2[*axis]), kAxisName[*axis],
          milli_mps2(calibration.floor_pose_rms_mps2[*axis])));
    }
    const auto worst = [](const PerAxis<double>& v) {
      return *std::max_element(v.begin(), v.end());
    };
    document.summary.push_back(
        c.tr("On {} fresh poses the error is at most {} mm/s² RMS per axis, {} mm/s² at the single "
             "worst pose.",
             fresh->poses, milli_mps2(worst(fresh->after.pose_rms_mps2)),
             milli_mps2(worst(fresh->after.pose_max_abs_mps2))));
  }
}

void add_figures(const Composer& c) {
  const FigureContext context{c.calibration, c.tr};
  std::vector<Figure> figures = {residual_map(context, c.input.description.grid),
                                 residual_histogram(context)};
  if (auto terms = fitted_terms_figure(context)) figures.push_back(*std::move(terms));
  figures.push_back(residual_course(context));
  c.add(Heading{c.tr("Pictures of the residual")});
  c.add(Paragraph{
      c.tr("Figures {} to {}: what the model leaves of every pose, measured less calculated and "
           "referred to the input.",
           c.figures() + 1, c.figures() + figures.size())});
  for (Figure& figure : figures) c.add(std::move(figure));
}

}  // namespace
}  // namespace content

std::string certificate_id(const Provenance& provenance) {
  std::string date = provenance.created_utc.substr(0, 10);
  std::erase(date, '-');
  const std::string hash =
      provenance.input_sha256.empty() ? "" : provenance.input_sha256.front().second.substr(0, 8);
  return fmt::format("PL-{}-{}-{}", provenance.dut.serial, date, hash);
}

PerformanceDates performance_dates(const CertificateInput& input) {
  const Laboratory& lab = input.laboratory;
  PerformanceDates dates{lab.performed_from, lab.performed_to};
  if (dates.from.empty()) dates.from = input.started_utc.substr(0, 10);
  if (dates.to.empty()) dates.to = input.finished_utc.substr(0, 10);
  if (dates.to.empty()) dates.to = dates.from;
  if (dates.from.empty()) dates.from = dates.to;
  return dates;
}

bool is_unfinished(const std::vector<CertificateEvent>& events) {
  return std::any_of(events.begin(), events.end(),
                     [](const CertificateEvent& event) { return event.kind == kIncomplete; });
}

Decision stated_decision(Decision decision, const std::vector<CertificateEvent>& events) {
  const bool passes = decision.status == DecisionStatus::pass ||
                      decision.status == DecisionStatus::conditional_pass;
  if (passes && is_unfinished(events)) decision.status = DecisionStatus::none;
  return decision;
}

Document make_certificate(const CertificateInput& input, const Translator& tr) {
  Document document;
  const content::Composer composer{document, input, tr,
                                   std::make_shared<const Calibration>(input.calibration)};
  document.language = code_of(tr.language());
  document.title = tr("Calibration certificate");
  const std::string serial =
      input.description.dut.serial.empty() ? tr("not stated") : input.description.dut.serial;
  document.subtitle = input.scalar != nullptr
                          ? tr("Accelerometer triad, serial number {}; scalar calibration", serial)
                          : tr("Accelerometer triad, serial number {}", serial);
  document.id = certificate_id(input.provenance);
  document.words.missing = tr("not stated");
  document.words.page_of = tr("page {} of {}");
  document.words.end = tr("— end of certificate {} —", document.id);
  content::add_summary(composer);
  content::add_identification(composer);
  content::add_method(composer);
  if (input.scalar != nullptr) {
    content::add_scalar_results(composer);
    content::add_scalar_errors(composer);
    content::add_findings(composer);
    content::add_decision(composer);
    content::add_scalar_budget(composer);
    content::add_noise(composer);
  } else {
    content::add_parameters(composer);
    content::add_errors(composer);
    content::add_findings(composer);
    content::add_decision(composer);
    content::add_budget(composer);
    content::add_estimators(composer);
    content::add_figures(composer);
    content::add_noise(composer);
  }
  content::add_history(composer);
  document.colophon =
      tr("The results relate only to the item calibrated. This certificate may not be reproduced "
         "except in full.");
  document.fingerprint = fingerprint(document);
  document.words.fingerprint =
      tr("Fingerprint of the text above (SHA-256 of its words): {}", document.fingerprint);
  return document;
}

Document make_certificate(const CertificateInput& input) {
  return make_certificate(input, Translator(input.language));
}

}  // namespace plumbline::app
