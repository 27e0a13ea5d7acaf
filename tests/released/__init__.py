"""Files of every release as its commands wrote them; each later version reads them, nobody changes them."""
