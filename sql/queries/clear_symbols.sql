DELETE FROM postures;
DELETE FROM symbol_strings;
