"""Seals of documents: PAdES in a PDF, XAdES in a digital calibration certificate.

`x509` has trusted certificates and the judgement of a signer, `key` the laboratory's key; `pdf` and `xml`
seal bytes and check them; `attachments` puts a proof into a PDF, `qr` on paper.
"""
