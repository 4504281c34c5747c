SELECT count(*)::BIGINT AS sources FROM sources;
