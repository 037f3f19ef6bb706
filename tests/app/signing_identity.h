// Who signs certificates in tests.
#pragma once

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <string>

namespace plumbline::app {

/// A key and a certificate for it by `issuer` (itself when there is none), as PEM files.
class Identity {
 public:
  explicit Identity(const std::string& name, const Identity* issuer = nullptr,
                    EVP_PKEY* key = EVP_EC_gen("P-256"))
      : key_(key), certificate_(X509_new()) {
    X509_set_version(certificate_, 2);
    ASN1_INTEGER_set(X509_get_serialNumber(certificate_), 7);
    X509_gmtime_adj(X509_getm_notBefore(certificate_), -60);
    X509_gmtime_adj(X509_getm_notAfter(certificate_), 86400);
    X509_set_pubkey(certificate_, key_);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate_), "CN", MBSTRING_UTF8,
                               reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
    X509_EXTENSION* authority =
        X509V3_EXT_conf_nid(nullptr, nullptr, NID_basic_constraints, "critical,CA:TRUE");
    X509_add_ext(certificate_, authority, -1);
    X509_EXTENSION_free(authority);
    const Identity& by = issuer == nullptr ? *this : *issuer;
    X509_set_issuer_name(certificate_, X509_get_subject_name(by.certificate_));
    X509_sign(certificate_, by.key_, EVP_sha256());
  }
  ~Identity() {
    X509_free(certificate_);
    EVP_PKEY_free(key_);
  }
  Identity(const Identity&) = delete;
  Identity& operator=(const Identity&) = delete;

  void expire() {
    X509_gmtime_adj(X509_getm_notAfter(certificate_), -30);
    X509_sign(certificate_, key_, EVP_sha256());
  }
  std::string certificate_pem() const {
    return pem([&](BIO* bio) { PEM_write_bio_X509(bio, certificate_); });
  }
  std::string key_pem(const char* passphrase = nullptr) const {
    return pem([&](BIO* bio) {
      PEM_write_bio_PKCS8PrivateKey(bio, key_, passphrase == nullptr ? nullptr : EVP_aes_128_cbc(),
                                    nullptr, 0, nullptr, const_cast<char*>(passphrase));
    });
  }

 private:
  template <class Write>
  static std::string pem(const Write& write) {
    BIO* bio = BIO_new(BIO_s_mem());
    write(bio);
    const char* data = nullptr;
    const auto size = BIO_get_mem_data(bio, &data);
    std::string text(data, static_cast<std::size_t>(size));
    BIO_free(bio);
    return text;
  }

  EVP_PKEY* key_;
  X509* certificate_;
};

}  // namespace plumbline::app
